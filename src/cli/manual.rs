//! Completions for shells and the manual page, generated from the definition of the command line.

use clap::{Command, CommandFactory};
use clap_complete::Shell;
use clap_mangen::Man;
use std::io::Write;

/// Returns the script that completes commands and options in a shell.
pub(super) fn completions<C: CommandFactory>(shell: Shell) -> Vec<u8> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut C::command(), "solver", &mut script);
    script
}

/// Returns the manual page of the program and, below, of each of its commands, in roff: `solver man | man -l -`.
///
/// # Errors
/// If writing fails, which cannot happen in memory.
pub(super) fn page<C: CommandFactory>() -> std::io::Result<Vec<u8>> {
    let mut command = C::command();
    command.build();
    let mut page = Vec::new();
    let whole = Man::new(command.clone());
    whole.render_title(&mut page)?;
    whole.render_name_section(&mut page)?;
    whole.render_synopsis_section(&mut page)?;
    whole.render_description_section(&mut page)?;
    whole.render_options_section(&mut page)?;
    for sub in command.get_subcommands().filter(|c| !c.is_hide_set()) {
        one_command(sub, &mut page)?;
    }
    whole.render_extra_section(&mut page)?;
    whole.render_version_section(&mut page)?;
    Ok(page)
}

/// Writes the section of a command with its subsections one level lower, so that all commands form one page.
fn one_command(command: &Command, page: &mut Vec<u8>) -> std::io::Result<()> {
    let man = Man::new(command.clone());
    let mut section = Vec::new();
    man.render_description_section(&mut section)?;
    man.render_synopsis_section(&mut section)?;
    if command.get_arguments().next().is_some() {
        man.render_options_section(&mut section)?;
    }
    writeln!(page, ".SH \"SOLVER {}\"", command.get_name().to_uppercase())?;
    for line in String::from_utf8_lossy(&section).lines() {
        match line.strip_prefix(".SH ") {
            Some("DESCRIPTION") => {}
            Some(name) => writeln!(page, ".SS {name}")?,
            // The preamble belongs to separate pages only.
            None if line.starts_with(".ie ") || line.starts_with(".el ") => {}
            None => writeln!(page, "{line}")?,
        }
    }
    Ok(())
}
