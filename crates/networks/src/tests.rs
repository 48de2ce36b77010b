//! The layers against numbers of another implementation (tests/keras.py) and finite differences, and training.

use crate::NetworksError;
use crate::adam::{Moments, descend};
use crate::examples::Examples;
use crate::network::{Form, Kind, Layer, Reading};
use crate::protocol::{Plan, Stage, train};
use crate::recurrence::Gate;
use crate::training::Training;
use crate::window::Window;
use candle_core::{Device, Tensor, Var};
use std::ops::ControlFlow;
use std::path::Path;

/// What tests/keras.py prints.
const LSTM: [f32; 2] = [0.254738, 0.201327];
const CONV_LSTM: [f32; 2] = [0.077516, 0.118363];
const ADAM: f32 = 0.295028;

const KIND: Kind = Kind::Kinesthetic(Reading::Transposed);

fn lstm(units: usize, sequence: bool) -> Layer {
    Layer::Recurrent {
        units,
        window: Window::PIXEL,
        gate: Gate::Sigmoid,
        sequence,
    }
}

fn dense(units: usize, relu: bool) -> Layer {
    Layer::Dense { units, relu }
}

/// Two LSTMs as in the kinesthetic network, and a ConvLSTM with a convolution as in the tactile one, both small.
fn small() -> [(Vec<Layer>, Form); 2] {
    let conv_lstm = Layer::Recurrent {
        units: 2,
        window: Window { rows: 3, columns: 2 },
        gate: Gate::HardSigmoid,
        sequence: false,
    };
    let convolution = Layer::Convolution {
        units: 3,
        window: Window { rows: 2, columns: 2 },
    };
    [
        (
            vec![lstm(5, true), lstm(2, false), Layer::Flatten, dense(1, false)],
            [4, 1, 1, 3],
        ),
        (
            vec![conv_lstm, convolution, Layer::Flatten, dense(1, false)],
            [3, 4, 3, 1],
        ),
    ]
}

/// The weights of tests/keras.py.
fn sines(count: usize, scale: f64, phase: f64) -> Vec<f32> {
    (0..count)
        .map(|n| (scale * (n as f64 + phase).sin()) as f32)
        .collect()
}

fn with_known_weights((layers, form): (Vec<Layer>, Form)) -> Training {
    let training = Training::of_layers(KIND, layers, form, 1e-2, 1).unwrap();
    for (name, parameter) in training.network.parameters() {
        let (scale, phase) = match name.rsplit('.').next() {
            Some("kernel") => (0.6, 1.0),
            Some("recurrent") => (0.4, 2.0),
            _ => (0.5, 3.0),
        };
        let values = sines(parameter.elem_count(), scale, phase);
        parameter
            .set(&Tensor::from_vec(values, parameter.shape(), &Device::Cpu).unwrap())
            .unwrap();
    }
    training
}

/// Two examples whose sequence has the values of tests/keras.py.
fn known_sequence([steps, rows, columns, channels]: Form) -> Tensor {
    let shape = (steps, 2, rows, columns, channels);
    Tensor::from_vec(
        sines(2 * steps * rows * columns * channels, 1.0, 0.0),
        shape,
        &Device::Cpu,
    )
    .unwrap()
}

#[test]
fn layers_give_what_keras_documents() {
    let expected = [LSTM, CONV_LSTM];
    for (network, expected) in small().into_iter().zip(expected) {
        let form = network.1;
        let estimates = with_known_weights(network)
            .network
            .forward(&known_sequence(form))
            .unwrap();
        for (estimate, expected) in estimates.to_vec1::<f32>().unwrap().iter().zip(expected) {
            assert!((estimate - expected).abs() < 2e-6, "{estimate} is not {expected}");
        }
    }
}

#[test]
fn gradients_are_those_of_finite_differences() {
    for network in small() {
        let form = network.1;
        let network = with_known_weights(network).network;
        let sequence = known_sequence(form);
        let loss = || {
            network
                .forward(&sequence)
                .unwrap()
                .affine(1.0, -0.7)
                .unwrap()
                .sqr()
                .unwrap()
                .sum_all()
                .unwrap()
        };
        let gradients = loss().backward().unwrap();
        for (name, parameter) in network.parameters() {
            let gradient = gradients
                .get(parameter)
                .unwrap()
                .flatten_all()
                .unwrap()
                .to_vec1::<f32>()
                .unwrap();
            let values = parameter.flatten_all().unwrap().to_vec1::<f32>().unwrap();
            for n in 0..values.len() {
                let moved = |by: f32| {
                    let mut values = values.clone();
                    values[n] += by;
                    parameter
                        .set(&Tensor::from_vec(values, parameter.shape(), &Device::Cpu).unwrap())
                        .unwrap();
                    loss().to_scalar::<f32>().unwrap()
                };
                let step = 4e-3;
                let difference = (moved(step) - moved(-step)) / (2.0 * step);
                moved(0.0);
                let error = (difference - gradient[n]).abs();
                assert!(
                    error < 2e-3 + 5e-3 * difference.abs(),
                    "{name}[{n}]: {} is not {difference}",
                    gradient[n]
                );
            }
        }
    }
}

#[test]
fn adam_steps_as_keras_documents() {
    let parameter = Var::new(&[0.3f32], &Device::Cpu).unwrap();
    let mut moments = Moments::none(1);
    for (step, gradient) in [1.0f32, -2.0, 0.5].into_iter().enumerate() {
        let gradient = Tensor::new(&[gradient], &Device::Cpu).unwrap();
        descend(&parameter, &gradient, &mut moments, 0.01, step as u64 + 1).unwrap();
    }
    let found = parameter.to_vec1::<f32>().unwrap()[0];
    assert!((found - ADAM).abs() < 1e-6, "{found} is not {ADAM}");
}

#[test]
fn the_networks_have_the_weights_of_the_article() {
    // Section 4.1: a memory has 4 x (inputs + units + 1) x units, which a kernel multiplies by its places.
    let fusion = Training::new(Kind::Fusion, &fusion_examples(2), 1).unwrap();
    assert_eq!(fusion.weights(), 3 * 128 + 129 * 64 + 65 * 32 + 33);
    let tactile = Training::of_layers(Kind::Tactile, Kind::Tactile.layers(), [2, 4, 6, 1], 8e-4, 1).unwrap();
    let memory = 4 * (15 * (1 + 16) + 1) * 16;
    assert_eq!(
        tactile.weights(),
        memory + (4 * 16 + 1) * 32 + (4 * 6 * 32 + 1) * 64 + 65
    );
    // Its first weights take long to draw where nothing is optimised.
    let kinesthetic = Kind::Kinesthetic(Reading::Time).layers();
    assert_eq!(
        kinesthetic,
        [
            lstm(1000, true),
            lstm(500, true),
            lstm(100, false),
            Layer::Flatten,
            dense(1, false)
        ]
    );
}

fn fusion_examples(count: usize) -> Examples {
    let place = |n: usize| n as f32 / count as f32;
    let estimate = |n: usize| [place(n) + 0.1 * (n as f32).sin(), 0.8 * place(n) + 0.1];
    let estimates: Vec<[f32; 2]> = (0..count).map(estimate).collect();
    Examples::of_estimates(&estimates, (0..count).map(place).collect()).unwrap()
}

/// Sequences whose mean is the place.
fn sequences(form: Form) -> Examples {
    let size: usize = form.iter().product();
    let place = |n: usize| n as f32 / 40.0;
    let values = (0..40).flat_map(|n| (0..size).map(move |i| place(n) + 0.3 * ((7 * n + i) as f32).sin()));
    Examples::new(values.collect(), form, (0..40).map(place).collect()).unwrap()
}

#[test]
fn losses_fall_with_every_kind_of_layer() {
    for (layers, form) in small() {
        let (examples, rest) = (sequences(form), sequences(form).select(&[3, 20]).unwrap());
        let mut training = Training::of_layers(KIND, layers, form, 1e-2, 5).unwrap();
        let first = training.epoch(&examples, &rest).unwrap();
        for _ in 0..40 {
            training.epoch(&examples, &rest).unwrap();
        }
        let last = training.losses()[40];
        assert!(last.training < 0.2 * first.training, "{last:?} after {first:?}");
        assert!(last.validation < first.validation, "{last:?} after {first:?}");
    }
}

fn bits(training: &Training) -> Vec<Vec<u32>> {
    let values = |(_, var): &(String, Var)| var.flatten_all().unwrap().to_vec1::<f32>().unwrap();
    let bits = |values: Vec<f32>| values.iter().map(|value| value.to_bits()).collect();
    training
        .network
        .parameters()
        .iter()
        .map(|parameter| bits(values(parameter)))
        .collect()
}

#[test]
fn a_training_that_was_stopped_goes_on_to_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.json");
    for (layers, form) in small() {
        let examples = sequences(form);
        let rest = examples.select(&[]).unwrap();
        let new = || Training::of_layers(KIND, layers.clone(), form, 1e-2, 5).unwrap();
        let (mut whole, mut first, mut second) = (new(), new(), new());
        for _ in 0..5 {
            whole.epoch(&examples, &rest).unwrap();
        }
        first.epoch(&examples, &rest).unwrap();
        first.save(&path, &examples).unwrap();
        first.epoch(&examples, &rest).unwrap();
        first.save(&path, &examples).unwrap();
        second.restore(&path, &examples).unwrap();
        assert_eq!(second.epochs(), 2);
        for _ in 0..3 {
            second.epoch(&examples, &rest).unwrap();
        }
        assert_eq!(bits(&whole), bits(&second));
        // One whole checkpoint, and nothing else.
        let mut files: Vec<_> = folder
            .path()
            .read_dir()
            .unwrap()
            .map(|file| file.unwrap().file_name())
            .collect();
        files.sort();
        assert_eq!(files, ["small.2.safetensors", "small.json"]);
    }
}

fn train_fusion(
    folder: &Path,
    examples: &Examples,
    seed: u64,
    until: usize,
) -> Result<Training, NetworksError> {
    let stage = Stage {
        repetition: 0,
        kind: Kind::Fusion,
    };
    train(
        stage,
        examples,
        seed,
        6,
        Some(&folder.join("fusion-01.json")),
        &mut |progress| {
            assert_eq!((progress.stage, progress.epochs), (stage, 6));
            if progress.epoch == until {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        },
    )
}

#[test]
fn training_ends_when_told_and_goes_on_where_it_was() {
    let [whole, parts] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let examples = fusion_examples(40);
    let whole = train_fusion(whole.path(), &examples, 3, 6).unwrap();
    let stopped = train_fusion(parts.path(), &examples, 3, 2).unwrap();
    assert_eq!(stopped.epochs(), 2);
    let resumed = train_fusion(parts.path(), &examples, 3, 6).unwrap();
    assert_eq!((resumed.epochs(), bits(&resumed)), (6, bits(&whole)));
    assert!(whole.losses().iter().all(|losses| losses.validation.is_some()));
}

#[test]
fn fusion_begins_anew_when_the_networks_before_it_were_trained_on() {
    let [fresh, tried] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    train_fusion(tried.path(), &fusion_examples(40), 3, 2).unwrap();
    let [whole, anew] = [&fresh, &tried].map(|folder| {
        let until = 4;
        train_fusion(folder.path(), &fusion_examples(41), 3, until).unwrap()
    });
    assert_eq!((anew.epochs(), bits(&anew)), (4, bits(&whole)));
    // And is kept.
    let [whole, gone_on] = [&fresh, &tried].map(|folder| {
        let until = 6;
        train_fusion(folder.path(), &fusion_examples(41), 3, until).unwrap()
    });
    assert_eq!((gone_on.epochs(), bits(&gone_on)), (6, bits(&whole)));
}

#[test]
fn a_try_has_fewer_epochs_of_the_networks_that_take_long_alone() {
    let kinds = [Kind::Kinesthetic(Reading::Time), Kind::Tactile, Kind::Fusion];
    for (epochs, expected) in [(None, [2000, 500, 2500]), (Some(7), [7, 7, 2500])] {
        let plan = Plan {
            reading: Reading::Time,
            epochs,
            folder: None,
            seed: 1,
        };
        assert_eq!(kinds.map(|kind| plan.epochs_of(kind)), expected);
    }
}

#[test]
fn a_checkpoint_that_does_not_fit_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fusion-01.json");
    let examples = fusion_examples(40);
    let trained = train_fusion(folder.path(), &examples, 3, 2).unwrap();
    let refused = |examples: &Examples, seed| {
        train_fusion(folder.path(), examples, seed, 2)
            .unwrap_err()
            .to_string()
    };

    assert!(
        refused(&examples, 4).contains("was begun with seed 3"),
        "{}",
        refused(&examples, 4)
    );
    let mut other = Training::new(Kind::Fusion, &examples, 3).unwrap();
    let error = other
        .restore(&path, &fusion_examples(41))
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("fusion-01.json: was trained on other examples"),
        "{error}"
    );

    let tensors = folder
        .path()
        .join(format!("fusion-01.{}.safetensors", trained.epochs()));
    let whole = std::fs::read(&tensors).unwrap();
    for torn in [0, 7, 100, whole.len() - 1] {
        std::fs::write(&tensors, &whole[..torn]).unwrap();
        let error = refused(&examples, 3);
        assert!(
            error.contains("fusion-01.2.safetensors") && error.contains("damaged"),
            "{error}"
        );
    }
    std::fs::remove_file(&tensors).unwrap();
    assert!(refused(&examples, 3).contains("fusion-01.2.safetensors"));

    let header = std::fs::read_to_string(&path).unwrap();
    for (from, to, what) in [
        ("\"version\": 1", "\"version\": 2", "version 2"),
        ("\"network\"", "\"net\"", "no checkpoint"),
        ("fusion-01.2.", "../fusion-01.2.", "not a file beside it"),
    ] {
        std::fs::write(&path, header.replace(from, to)).unwrap();
        let error = refused(&examples, 3);
        assert!(
            error.contains(what) && error.contains("fusion-01.json"),
            "{error}"
        );
    }
}
