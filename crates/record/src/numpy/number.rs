//! Numbers as numpy has them.

use std::io::{self, Write};

/// A number that arrays are written of.
pub trait Number: Copy {
    /// Its type, in numpy's notation.
    const DESCRIPTOR: &str;

    /// Writes its bytes, the least significant first.
    fn write(self, out: &mut impl Write) -> io::Result<()>;
}

macro_rules! number {
    ($($number:ident $descriptor:literal),*) => {$(
        impl Number for $number {
            const DESCRIPTOR: &str = $descriptor;

            #[inline]
            fn write(self, out: &mut impl Write) -> io::Result<()> {
                out.write_all(&self.to_le_bytes())
            }
        }
    )*};
}

impl Number for bool {
    const DESCRIPTOR: &str = "|b1";

    fn write(self, out: &mut impl Write) -> io::Result<()> {
        u8::from(self).write(out)
    }
}

number!(u8 "|u1", u16 "<u2", u64 "<u8", f32 "<f4", f64 "<f8");
