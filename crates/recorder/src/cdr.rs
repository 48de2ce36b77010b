//! CDR, the encoding of ROS 2 messages: little-endian, every number at a multiple of its size.

/// Plain CDR, little-endian; offsets count from behind these.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// Writes one message.
#[derive(Debug)]
pub(crate) struct CdrWriter {
    bytes: Vec<u8>,
}

macro_rules! put {
    ($($name:ident $list:ident $type:ty),*) => {$(
        #[allow(dead_code, reason = "doubles come in lists alone")]
        pub(crate) fn $name(&mut self, value: $type) {
            self.align(size_of::<$type>());
            self.bytes.extend_from_slice(&value.to_le_bytes());
        }

        #[allow(dead_code, reason = "not every type has lists")]
        pub(crate) fn $list(&mut self, values: impl ExactSizeIterator<Item = $type>) {
            self.u32(values.len() as u32);
            if values.len() > 0 {
                self.align(size_of::<$type>());
            }
            for value in values {
                self.bytes.extend_from_slice(&value.to_le_bytes());
            }
        }
    )*};
}

impl CdrWriter {
    /// A message of about this many bytes.
    pub(crate) fn with_capacity(bytes: usize) -> Self {
        let mut buffer = Vec::with_capacity(ENCAPSULATION.len() + bytes);
        buffer.extend_from_slice(&ENCAPSULATION);
        Self { bytes: buffer }
    }

    fn align(&mut self, size: usize) {
        let len = self.bytes.len() - ENCAPSULATION.len();
        self.bytes
            .resize(ENCAPSULATION.len() + len.next_multiple_of(size), 0);
    }

    put!(u8 u8s u8, u16 u16s u16, u32 u32s u32, i32 i32s i32, u64 u64s u64, f32 f32s f32, f64 f64s f64);

    pub(crate) fn bytes(&mut self, values: &[u8]) {
        self.u32(values.len() as u32);
        self.bytes.extend_from_slice(values);
    }

    /// A text; one with a zero in it ends there.
    pub(crate) fn text(&mut self, text: &str) {
        let text = text.split('\0').next().unwrap_or_default();
        self.u32(text.len() as u32 + 1);
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.push(0);
    }

    pub(crate) fn texts<'t>(&mut self, texts: impl ExactSizeIterator<Item = &'t str>) {
        self.u32(texts.len() as u32);
        texts.for_each(|text| self.text(text));
    }

    pub(crate) fn finish(self) -> Vec<u8> {
        self.bytes
    }
}

/// Reads one message; what is not there reads as `None`.
#[derive(Debug, Clone)]
pub(crate) struct CdrReader<'a> {
    bytes: &'a [u8],
    at: usize,
}

/// A list of numbers of `N` bytes.
pub(crate) type Cells<'a, const N: usize> = &'a [[u8; N]];

macro_rules! take {
    ($($name:ident $type:ty),*) => {$(
        pub(crate) fn $name(&mut self) -> Option<$type> {
            self.cells_of(1).map(|[cell]: &[_; 1]| <$type>::from_le_bytes(*cell))
        }
    )*};
}

impl<'a> CdrReader<'a> {
    /// A reader of a whole message; none where it is of another encoding.
    pub(crate) fn new(message: &'a [u8]) -> Option<Self> {
        let bytes = message.strip_prefix(&ENCAPSULATION[..2])?.get(2..)?;
        Some(Self { bytes, at: 0 })
    }

    take!(u8 u8, u16 u16, u32 u32, u64 u64, f32 f32);

    fn cells_of<const N: usize, const M: usize>(&mut self, _one: usize) -> Option<&'a [[u8; N]; M]> {
        self.take(M)?.try_into().ok()
    }

    /// So many numbers of `N` bytes.
    fn take<const N: usize>(&mut self, count: usize) -> Option<Cells<'a, N>> {
        let at = if count == 0 {
            self.at
        } else {
            self.at.next_multiple_of(N)
        };
        let end = at.checked_add(count.checked_mul(N)?)?;
        let (cells, rest) = self.bytes.get(at..end)?.as_chunks();
        debug_assert!(rest.is_empty());
        self.at = end;
        Some(cells)
    }

    pub(crate) fn list<const N: usize>(&mut self) -> Option<Cells<'a, N>> {
        let count = self.u32()? as usize;
        self.take(count)
    }

    pub(crate) fn bytes(&mut self) -> Option<&'a [u8]> {
        self.list::<1>().map(<[[u8; 1]]>::as_flattened)
    }

    pub(crate) fn text(&mut self) -> Option<&'a str> {
        let (end, text) = self.bytes()?.split_last()?;
        (*end == 0).then(|| std::str::from_utf8(text).ok()).flatten()
    }

    pub(crate) fn texts(&mut self) -> Option<Vec<&'a str>> {
        let count = self.u32()? as usize;
        // A text has five bytes or more: memory only for what can be there.
        (count <= self.bytes.len() / 5)
            .then(|| (0..count).map(|_| self.text()).collect())
            .flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stand_at_multiples_of_their_size_behind_the_first_four_bytes() {
        let mut cdr = CdrWriter::with_capacity(0);
        cdr.u8(7);
        cdr.u16(0x0201);
        cdr.text("ab");
        cdr.u64(5);
        cdr.u64s([].into_iter());
        cdr.bytes(&[9]);
        let bytes = cdr.finish();
        let wanted = [
            &[0, 1, 0, 0][..],
            &[7, 0, 1, 2],
            &[3, 0, 0, 0, b'a', b'b', 0],
            &[0],
            &[0, 0, 0, 0],
            &[5, 0, 0, 0, 0, 0, 0, 0],
            &[0, 0, 0, 0],
            &[1, 0, 0, 0, 9],
        ]
        .concat();
        assert_eq!(bytes, wanted);
        let mut read = CdrReader::new(&bytes).unwrap();
        assert_eq!(
            (read.u8(), read.u16(), read.text()),
            (Some(7), Some(0x0201), Some("ab"))
        );
        assert_eq!((read.u64(), read.list::<8>().map(<[_]>::len)), (Some(5), Some(0)));
        assert_eq!((read.bytes(), read.u8()), (Some(&[9][..]), None));
    }

    #[test]
    fn lengths_that_lie_read_as_nothing() {
        for message in [
            &[0, 1, 0, 0, 255, 255, 255, 255][..],
            &[0, 1, 0, 0, 1, 0],
            &[0, 1],
            &[0, 0, 0, 0, 1],
        ] {
            let read = CdrReader::new(message);
            assert_eq!(read.clone().and_then(|mut read| read.text()), None);
            assert_eq!(read.clone().and_then(|mut read| read.texts()), None);
            assert_eq!(read.and_then(|mut read| read.list::<8>()), None);
        }
    }
}
