//! Numbers as little-endian bytes: the contents of messages between ranks.

use base::error::Error;

/// Writer that appends numbers to a message.
#[derive(Debug, Default)]
pub(super) struct Writer(pub(super) Vec<u8>);

impl Writer {
    #[inline]
    pub(super) fn float(&mut self, value: f64) {
        self.0.extend_from_slice(&value.to_le_bytes());
    }
    #[inline]
    pub(super) fn integer(&mut self, value: u64) {
        self.0.extend_from_slice(&value.to_le_bytes());
    }
    #[inline]
    pub(super) fn signed(&mut self, value: i32) {
        self.0.extend_from_slice(&value.to_le_bytes());
    }
}

/// Reader of numbers written by a [`Writer`], in the same order.
#[derive(Debug)]
pub(super) struct Reader<'a>(pub(super) &'a [u8]);

impl Reader<'_> {
    #[inline]
    fn take<const N: usize>(&mut self) -> Result<[u8; N], Error> {
        let (head, tail) = self
            .0
            .split_first_chunk::<N>()
            .ok_or_else(|| Error::Internal("a message between ranks is too short".into()))?;
        self.0 = tail;
        Ok(*head)
    }
    #[inline]
    pub(super) fn float(&mut self) -> Result<f64, Error> {
        Ok(f64::from_le_bytes(self.take()?))
    }
    #[inline]
    pub(super) fn integer(&mut self) -> Result<u64, Error> {
        Ok(u64::from_le_bytes(self.take()?))
    }
    /// Reads an integer that must fit 32 bits; `what` names it in the error.
    #[inline]
    pub(super) fn index(&mut self, what: &str) -> Result<u32, Error> {
        u32::try_from(self.integer()?)
            .map_err(|_| Error::Internal(format!("{what} in a message exceeds 32 bits")))
    }
    #[inline]
    pub(super) fn signed(&mut self) -> Result<i32, Error> {
        Ok(i32::from_le_bytes(self.take()?))
    }
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}
