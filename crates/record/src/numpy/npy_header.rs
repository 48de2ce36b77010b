//! The line of Python at the head of numpy's `.npy`.

/// What the header of an `.npy` says of the numbers behind it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Header {
    /// The type of an element in numpy's notation, such as `<u2`; none where elements have fields.
    pub(crate) descriptor: Option<String>,
    /// Whether the first index is the one that moves fastest.
    pub(crate) fortran_order: bool,
    pub(crate) shape: Vec<usize>,
}

impl Header {
    /// Reads a header such as `{'descr': '<u2', 'fortran_order': False, 'shape': (860, 48), }`.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let mut rest = Rest(text);
        let (mut descriptor, mut fortran_order, mut shape) = (None, None, None);
        rest.skip("{")?;
        while rest.skip("}").is_none() {
            let key = rest.quoted()?;
            rest.skip(":")?;
            match key {
                "descr" => descriptor = Some(rest.descriptor()?),
                "fortran_order" => fortran_order = Some(rest.truth()?),
                "shape" => shape = Some(rest.sizes()?),
                _ => return None,
            }
            if rest.skip(",").is_none() && !rest.0.starts_with('}') {
                return None;
            }
        }
        rest.0.is_empty().then_some(Self {
            descriptor: descriptor?,
            fortran_order: fortran_order?,
            shape: shape?,
        })
    }

    /// The head of a file, up to its numbers, which begin at a multiple of 64 bytes.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let Self { shape, .. } = self;
        let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
        let comma = if shape.len() == 1 { "," } else { "" };
        let text = format!(
            "{{'descr': '{}', 'fortran_order': {}, 'shape': ({}{comma})}}",
            self.descriptor.as_deref().unwrap_or_default(),
            if self.fortran_order { "True" } else { "False" },
            sizes.join(", "),
        );
        let length = (10 + text.len() + 1).next_multiple_of(64) - 10;
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((length as u16).to_le_bytes());
        bytes.extend(format!("{text:0$}\n", length - 1).bytes());
        bytes
    }
}

/// What has not been read yet.
struct Rest<'a>(&'a str);

impl<'a> Rest<'a> {
    fn skip(&mut self, token: &str) -> Option<()> {
        self.0 = self.0.trim_start().strip_prefix(token)?.trim_start();
        Some(())
    }

    fn quoted(&mut self) -> Option<&'a str> {
        let quote = self.0.chars().next().filter(|c| "'\"".contains(*c))?;
        let (text, rest) = self.0[1..].split_once(quote)?;
        self.0 = rest.trim_start();
        Some(text)
    }

    /// The type of an element; of one with fields, `[('x', '<f4'), ..]`, no more than where it ends.
    fn descriptor(&mut self) -> Option<Option<String>> {
        if !self.0.starts_with('[') {
            return Some(Some(self.quoted()?.to_owned()));
        }
        let mut depth = 0;
        let end = self.0.find(|c| {
            depth += i32::from(c == '[') - i32::from(c == ']');
            depth == 0
        })?;
        self.0 = self.0[end + 1..].trim_start();
        Some(None)
    }

    fn truth(&mut self) -> Option<bool> {
        let is_true = self.skip("True").is_some();
        (is_true || self.skip("False").is_some()).then_some(is_true)
    }

    fn sizes(&mut self) -> Option<Vec<usize>> {
        self.skip("(")?;
        let (sizes, rest) = self.0.split_once(')')?;
        self.0 = rest.trim_start();
        let sizes = sizes.strip_suffix(',').unwrap_or(sizes);
        if sizes.is_empty() {
            return Some(Vec::new());
        }
        sizes.split(',').map(|size| size.trim().parse().ok()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(descriptor: Option<&str>, fortran_order: bool, shape: &[usize]) -> Header {
        Header {
            descriptor: descriptor.map(str::to_owned),
            fortran_order,
            shape: shape.to_vec(),
        }
    }

    #[test]
    fn headers_are_read_as_python_would() {
        for (text, wanted) in [
            (
                "{'descr': '<u2', 'fortran_order': False, 'shape': (860, 48), }",
                header(Some("<u2"), false, &[860, 48]),
            ),
            (
                " {\"shape\":(3,),\"fortran_order\":True,\"descr\":\"|b1\"}   \n",
                header(Some("|b1"), true, &[3]),
            ),
            (
                "{'descr': '<f8', 'fortran_order': False, 'shape': ()}",
                header(Some("<f8"), false, &[]),
            ),
            (
                "{'descr': [('x', '<f4', (2,)), ('y', [('z', '<i8')])], 'fortran_order': False, 'shape': (5,)}",
                header(None, false, &[5]),
            ),
        ] {
            assert_eq!(Header::parse(text), Some(wanted), "{text}");
        }
    }

    #[test]
    fn other_texts_are_no_headers() {
        for text in [
            "",
            "{",
            "{}",
            "[1, 2]",
            "{'descr': '<u2', 'fortran_order': False}",
            "{'descr': '<u2', 'fortran_order': 0, 'shape': (3,)}",
            "{'descr': '<u2', 'fortran_order': False, 'shape': (3, -1)}",
            "{'descr': '<u2', 'fortran_order': False, 'shape': (3,,)}",
            "{'descr': '<u2', 'fortran_order': False, 'shape': 3}",
            "{'descr': '<u2' 'fortran_order': False, 'shape': (3,)}",
            "{'descr': '<u2', 'fortran_order': False, 'shape': (3,)} 1",
            "{'descr': '<u2', 'fortran_order': False, 'shape': (3,), 'unit': 'N'}",
            "{'descr': [('x', '<f4'), 'fortran_order': False, 'shape': (3,)}",
            "{'descr': '<u2', 'fortran_order': False, 'shape': (99999999999999999999999,)}",
        ] {
            assert_eq!(Header::parse(text), None, "{text}");
        }
    }

    #[test]
    fn a_head_is_read_back_and_ends_at_a_multiple_of_64_bytes() {
        for digits in 0..70 {
            let shape = vec![7; digits];
            let wanted = header(Some("<u2"), false, &shape);
            let bytes = wanted.to_bytes();
            assert!(bytes.len().is_multiple_of(64), "{}", bytes.len());
            assert_eq!(
                Header::parse(std::str::from_utf8(&bytes[10..]).unwrap()),
                Some(wanted)
            );
        }
    }
}
