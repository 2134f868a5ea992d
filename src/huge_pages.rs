//! Huge pages for the small blocks of memory that the program allocates; the large ones have pages of their own ([`crate::allocator`]).
//!
//! The maps of bodies are thousands of small blocks, 10 MB together for 343 spheres in water, which every step reads once. In pages of 4 KiB the
//! processor waits for the translation of addresses: the mapping takes half as long again. The allocator of glibc (2.35 and later) advises huge pages only
//! if the environment says so before the program starts (`glibc.malloc.hugetlb=1`, the tunables of the GNU C library manual).

use std::ffi::OsString;

/// The variable that the allocator reads, and its word for advice.
const VARIABLE: &str = "GLIBC_TUNABLES";
const NAME: &str = "glibc.malloc.hugetlb";

/// Where Linux says who gets huge pages.
const SWITCH: &str = "/sys/kernel/mm/transparent_hugepage/enabled";

/// Starts the program again with the word in its environment, in the same process, where the operating system gives huge pages to those who ask.
/// Returns where it does not, where the environment already has a word for it (`GLIBC_TUNABLES=glibc.malloc.hugetlb=0` turns it off), and
/// where the program cannot be started again. Call it first of all. Debuggers and tools that count instructions follow the first start alone: turn it
/// off for them.
pub fn ask() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        use std::os::unix::process::CommandExt;
        let given = std::fs::read_to_string(SWITCH).unwrap_or_default();
        let Some(tunables) = tunables(&given, std::env::var_os(VARIABLE)) else {
            return;
        };
        let mut words = std::env::args_os();
        let (Ok(program), Some(name)) = (std::env::current_exe(), words.next()) else {
            return;
        };
        let mut again = std::process::Command::new(program);
        // It returns only if it failed: then everything goes on in small pages.
        let _ = again.arg0(name).args(words).env(VARIABLE, tunables).exec();
    }
}

/// The tunables with the word, given the switch of the system; none where there is nothing to ask for.
fn tunables(switch: &str, now: Option<OsString>) -> Option<OsString> {
    let word = format!("{NAME}=1");
    if !switch.contains("[madvise]") {
        return None;
    }
    let Some(mut all) = now.filter(|now| !now.is_empty()) else {
        return Some(word.into());
    };
    if all.to_string_lossy().contains(NAME) {
        return None;
    }
    all.push(":");
    all.push(word);
    Some(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn asked_for_once_and_where_it_helps() {
        let on = "always [madvise] never";
        let word = || Some(OsString::from("glibc.malloc.hugetlb=1"));
        assert_eq!(tunables(on, None), word());
        assert_eq!(tunables(on, Some(OsString::new())), word());
        assert_eq!(tunables(on, word()), None);
        assert_eq!(tunables(on, Some("glibc.malloc.hugetlb=0".into())), None);
        assert_eq!(
            tunables(on, Some("glibc.malloc.check=1".into())),
            Some("glibc.malloc.check=1:glibc.malloc.hugetlb=1".into())
        );
        assert_eq!(tunables("[always] madvise never", None), None);
        assert_eq!(tunables("always madvise [never]", None), None);
        assert_eq!(tunables("", None), None);
    }
}
