//! Sorting of rows over ranks, so that the order in files does not depend on the number of ranks.

use base::error::Error;
use decomposition::{Communicator, exchange};

/// Sorts rows of numbers over all ranks. Each rank receives the rows whose first number (an id) lies in its
/// interval of ids, sorted, so that the rows of rank 0, 1, … form one sorted list. Collective.
///
/// # Errors
/// If a message is not a list of rows, [`Error::Internal`].
pub(crate) fn sorted<const N: usize>(
    communicator: &Communicator,
    mut rows: Vec<[u64; N]>,
) -> Result<Vec<[u64; N]>, Error> {
    if communicator.size() > 1 {
        let largest = rows.iter().map(|row| row[0]).max().unwrap_or(0);
        let largest = communicator.all_reduce_max_u64(largest);
        let ranks = communicator.size() as u64;
        let share = largest / ranks + 1;
        let mut messages = vec![Vec::new(); communicator.size()];
        for row in &rows {
            let rank = usize::try_from(row[0] / share).unwrap_or(usize::MAX);
            if let Some(message) = messages.get_mut(rank) {
                row.iter()
                    .for_each(|number| message.extend_from_slice(&number.to_le_bytes()));
            }
        }
        rows.clear();
        for (source, bytes) in exchange(communicator, messages.into_iter().enumerate().collect()) {
            let (numbers, rest) = bytes.as_chunks::<8>();
            let (whole, torn) = numbers.as_chunks::<N>();
            if !rest.is_empty() || !torn.is_empty() {
                return Err(Error::Internal(format!(
                    "rank {source} sent {} bytes, which is not a whole number of rows",
                    bytes.len()
                )));
            }
            rows.extend(whole.iter().map(|row| row.map(u64::from_le_bytes)));
        }
    }
    rows.sort_unstable();
    Ok(rows)
}

/// Returns three consecutive numbers of a row, from index `first`.
pub(crate) fn vector<const N: usize>(row: &[u64; N], first: usize) -> [f64; 3] {
    std::array::from_fn(|k| f64::from_bits(row[first + k]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_rank_sorts_by_id_first() {
        let rows = vec![[3, 0], [1, 9], [1, 2]];
        let sorted = sorted(&Communicator::serial(), rows).unwrap();
        assert_eq!(sorted, [[1, 2], [1, 9], [3, 0]]);
    }
}
