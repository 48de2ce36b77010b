//! Training kept in files: `NAME.json`, which says what was trained and how far, and `NAME.EPOCHS.safetensors` with the
//! weights and Adam's moments. The first is replaced in one step, after the second is on the disk, so that whenever the
//! program ends there is one whole checkpoint.

use crate::adam::Moments;
use crate::error::NetworksError;
use crate::examples::Examples;
use crate::network::{Form, Kind};
use crate::training::{Losses, Training};
use candle_core::{Device, Tensor, safetensors};
use std::collections::HashMap;
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

const VERSION: u32 = 1;

#[derive(serde::Serialize, serde::Deserialize)]
struct Header {
    version: u32,
    network: Kind,
    /// Steps, rows, columns and channels of an example.
    form: Form,
    seed: u64,
    rate: f64,
    /// Of the training examples.
    fingerprint: String,
    epochs: usize,
    steps: u64,
    seconds: f64,
    /// The file of weights and moments, beside this one.
    tensors: String,
    losses: Vec<Losses>,
}

impl Training {
    /// Keeps the training in `path`, a `.json`, and in a file beside it. `training` is what it is trained on.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn save(&self, path: &Path, training: &Examples) -> Result<(), NetworksError> {
        let before = Header::read(path).ok().flatten().map(|header| header.tensors);
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let header = Header {
            version: VERSION,
            network: self.kind,
            form: self.form,
            seed: self.seed,
            rate: self.rate,
            fingerprint: format!("{:016x}", training.fingerprint()?),
            epochs: self.epochs(),
            steps: self.steps,
            seconds: self.seconds,
            tensors: format!("{stem}.{}.safetensors", self.epochs()),
            losses: self.losses.clone(),
        };
        let mut tensors = HashMap::new();
        for ((name, parameter), moments) in self.network.parameters().iter().zip(&self.moments) {
            tensors.insert(name.clone(), parameter.as_detached_tensor());
            for (part, values) in [("first", &moments.first), ("second", &moments.second)] {
                let moment = Tensor::from_slice(values, parameter.shape(), &Device::Cpu)?;
                tensors.insert(format!("{name}.{part}"), moment);
            }
        }
        let beside = path.with_file_name(&header.tensors);
        safetensors::save(&tensors, &beside)?;
        File::open(&beside)
            .and_then(|file| file.sync_all())
            .map_err(io(&beside))?;
        let text = serde_json::to_string_pretty(&header).map_err(|error| io(path)(error.into()))?;
        let new = path.with_extension("json.new");
        let write = || {
            let mut file = File::create(&new)?;
            file.write_all(text.as_bytes())?;
            file.sync_all()?;
            fs::rename(&new, path)
        };
        write().map_err(io(path))?;
        if let Some(before) = before.filter(|before| *before != header.tensors) {
            // It is of no use any more; where it cannot be removed it only takes room.
            let _ = fs::remove_file(path.with_file_name(before));
        }
        Ok(())
    }

    /// Goes on from the checkpoint in `path`, if there is one. It must be of what would now begin: the same network, seed and
    /// examples.
    ///
    /// # Errors
    /// A file that cannot be read, is damaged, or is of another run.
    pub fn restore(&mut self, path: &Path, training: &Examples) -> Result<(), NetworksError> {
        let Some(header) = Header::read(path)? else {
            return Ok(());
        };
        let unfit = |what: &str| {
            let what = format!("{what}; name another folder, or delete this checkpoint to begin anew");
            Err(NetworksError::Checkpoint {
                path: path.into(),
                what,
            })
        };
        let fingerprint = format!("{:016x}", training.fingerprint()?);
        if header.network != self.kind || header.form != self.form {
            return unfit(&format!(
                "is of the network {} for examples of {:?}",
                header.network, header.form
            ));
        }
        if header.seed != self.seed || header.rate != self.rate {
            return unfit(&format!(
                "was begun with seed {} and rate {}",
                header.seed, header.rate
            ));
        }
        if header.fingerprint != fingerprint {
            return Err(NetworksError::OtherExamples { path: path.into() });
        }
        if header.losses.len() != header.epochs {
            return unfit(&format!(
                "has {} epochs and losses of {}",
                header.epochs,
                header.losses.len()
            ));
        }
        let beside = path.with_file_name(&header.tensors);
        let damaged = |error: candle_core::Error| NetworksError::Checkpoint {
            path: beside.clone(),
            what: format!("is damaged ({error}); delete {} to begin anew", path.display()),
        };
        let tensors = safetensors::load(&beside, &Device::Cpu).map_err(damaged)?;
        let get = |name: &str, like: &Tensor| {
            let tensor = tensors.get(name).filter(|tensor| tensor.shape() == like.shape());
            tensor.ok_or_else(|| {
                damaged(candle_core::Error::Msg(format!(
                    "{name} is missing or of another shape"
                )))
            })
        };
        for ((name, parameter), moments) in self.network.parameters().iter().zip(&mut self.moments) {
            parameter.set(get(name, parameter)?).map_err(damaged)?;
            let moment = |part| {
                get(&format!("{name}.{part}"), parameter)?
                    .flatten_all()?
                    .to_vec1()
                    .map_err(damaged)
            };
            *moments = Moments {
                first: moment("first")?,
                second: moment("second")?,
            };
        }
        (self.steps, self.seconds, self.losses) = (header.steps, header.seconds, header.losses);
        Ok(())
    }
}

impl Header {
    fn read(path: &Path) -> Result<Option<Self>, NetworksError> {
        let text = match fs::read(path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(io(path)(error)),
        };
        let unfit = |what: String| NetworksError::Checkpoint {
            path: path.into(),
            what,
        };
        #[derive(serde::Deserialize)]
        struct Version {
            version: u32,
        }
        let no_checkpoint = |error| unfit(format!("is no checkpoint ({error}); delete it to begin anew"));
        let Version { version } = serde_json::from_slice(&text).map_err(no_checkpoint)?;
        if version != VERSION {
            return Err(unfit(format!(
                "is of version {version}, this program knows {VERSION}; use the program it was made by"
            )));
        }
        let header: Self = serde_json::from_slice(&text).map_err(no_checkpoint)?;
        let plain = Path::new(&header.tensors)
            .file_name()
            .is_some_and(|name| name == header.tensors.as_str());
        if !plain {
            return Err(unfit(format!(
                "names {} for its weights, which is not a file beside it",
                header.tensors
            )));
        }
        Ok(Some(header))
    }
}

fn io(path: &Path) -> impl Fn(std::io::Error) -> NetworksError + use<> {
    let path: PathBuf = path.into();
    move |source| NetworksError::Io {
        path: path.clone(),
        source,
    }
}
