//! A kernel that slides over images, with padding "same" as TensorFlow pads: the odd row or column goes below or right.

use candle_core::{CpuStorage, CustomOp2, DType, Layout, Result, Shape, Tensor};

/// Rows and columns that a kernel covers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Window {
    pub(crate) rows: usize,
    pub(crate) columns: usize,
}

impl Window {
    /// One pixel: what it does to an image is a matrix product.
    pub(crate) const PIXEL: Self = Self { rows: 1, columns: 1 };

    pub(crate) fn places(self) -> usize {
        self.rows * self.columns
    }

    /// Calls `copy` with where in the image, and where in its patch, each part of a patch is that lies within the image:
    /// `channels` values each.
    fn each(self, [count, rows, columns, channels]: [usize; 4], mut copy: impl FnMut(usize, usize)) {
        let (above, left) = ((self.rows - 1) / 2, (self.columns - 1) / 2);
        let places = self.places();
        for pixel in 0..count * rows * columns {
            let (row, column) = (pixel / columns % rows, pixel % columns);
            for place in 0..places {
                let (down, right) = (place / self.columns, place % self.columns);
                let y = (row + down).wrapping_sub(above);
                let x = (column + right).wrapping_sub(left);
                if y < rows && x < columns {
                    let source = pixel + down * columns + right - above * columns - left;
                    copy(source * channels, (pixel * places + place) * channels);
                }
            }
        }
    }

    /// The patch around each pixel of images (count, rows, columns, channels), one after another; 0 outside.
    pub(crate) fn patches(self, images: &[f32], shape: [usize; 4]) -> Vec<f32> {
        let mut patches = vec![0.0; images.len() * self.places()];
        let channels = shape[3];
        self.each(shape, |image, patch| {
            patches[patch..][..channels].copy_from_slice(&images[image..][..channels]);
        });
        patches
    }

    /// Adds up patches to images: the transpose of [`Window::patches`].
    pub(crate) fn overlap(self, patches: &[f32], shape: [usize; 4]) -> Vec<f32> {
        let mut images = vec![0.0; shape.iter().product()];
        let channels = shape[3];
        self.each(shape, |image, patch| {
            let parts = images[image..][..channels]
                .iter_mut()
                .zip(&patches[patch..][..channels]);
            parts.for_each(|(sum, part)| *sum += part);
        });
        images
    }

    /// Images (count, rows, columns, channels) times a kernel (places x channels, outputs): (count, rows, columns, outputs).
    pub(crate) fn apply(self, images: &Tensor, kernel: &Tensor) -> Result<Tensor> {
        let (count, rows, columns, channels) = images.dims4()?;
        if self == Self::PIXEL {
            let pixels = images.reshape((count * rows * columns, channels))?;
            return pixels.matmul(kernel)?.reshape((count, rows, columns, ()));
        }
        images.contiguous()?.apply_op2(kernel, self)
    }
}

impl CustomOp2 for Window {
    fn name(&self) -> &'static str {
        "window"
    }

    fn cpu_fwd(
        &self,
        images: &CpuStorage,
        at: &Layout,
        kernel: &CpuStorage,
        kernel_at: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let (count, rows, columns, channels) = at.shape().dims4()?;
        let patches = self.patches(floats(images, at)?, [count, rows, columns, channels]);
        let pixels = count * rows * columns;
        let (products, outputs) = product(patches, pixels, kernel, kernel_at)?;
        Ok((products, Shape::from((count, rows, columns, outputs))))
    }

    fn bwd(
        &self,
        images: &Tensor,
        kernel: &Tensor,
        _: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let (count, rows, columns, channels) = images.dims4()?;
        let shape = [count, rows, columns, channels];
        let (inputs, outputs) = kernel.dims2()?;
        let gradient = gradient.reshape((count * rows * columns, outputs))?;
        let of_images = images.track_op().then(|| {
            let patches = gradient.matmul(&kernel.t()?)?.flatten_all()?.to_vec1::<f32>()?;
            Tensor::from_vec(self.overlap(&patches, shape), images.shape(), images.device())
        });
        let patches = self.patches(&images.flatten_all()?.to_vec1::<f32>()?, shape);
        let patches = Tensor::from_vec(patches, (count * rows * columns, inputs), images.device())?;
        Ok((of_images.transpose()?, Some(patches.t()?.matmul(&gradient)?)))
    }
}

/// The values of a tensor, in their order.
pub(crate) fn floats<'a>(storage: &'a CpuStorage, at: &Layout) -> Result<&'a [f32]> {
    let values = storage.as_slice::<f32>()?;
    match at.contiguous_offsets() {
        Some((from, to)) => Ok(&values[from..to]),
        None => candle_core::bail!("a tensor of {:?} must be contiguous here", DType::F32),
    }
}

/// `rows` rows times a matrix, and how many columns that has.
pub(crate) fn product(
    values: Vec<f32>,
    rows: usize,
    matrix: &CpuStorage,
    at: &Layout,
) -> Result<(CpuStorage, usize)> {
    use candle_core::backend::BackendStorage;
    let (inputs, outputs) = at.shape().dims2()?;
    let left = Layout::contiguous((rows, inputs));
    let product = CpuStorage::F32(values).matmul(matrix, (1, rows, outputs, inputs), &left, at)?;
    Ok((product, outputs))
}
