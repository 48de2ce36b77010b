//! What can be wrong with a layout, in words that name the place.

use crate::protocol::Protocol;
use taxel_hand::{MAX_PIXELS, MAX_TAXELS, did_you_mean};

/// Why there is no layout.
#[derive(Debug, thiserror::Error)]
pub enum LayoutError {
    /// The file could not be read.
    #[error("cannot read the layout file {path}: {source}")]
    Read {
        /// The file.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// Neither a built-in hand nor a file.
    #[error("there is no layout {name:?}: it is neither a file nor built in ({builtin}) nor grid:HxW{}",
        did_you_mean(name, builtin.split(", ")))]
    Unknown {
        /// The name given.
        name: String,
        /// The built-in names.
        builtin: String,
    },
    /// A grid that does not read `grid:HxW`.
    #[error("{0:?} is not a grid of taxels; write rows and columns, as in grid:16x16")]
    BadGrid(String),
    /// A grid without taxels or with too many.
    #[error("a grid of {height} rows and {width} columns does not have 1 to {MAX_TAXELS} taxels")]
    GridSize {
        /// Columns.
        width: u16,
        /// Rows.
        height: u16,
    },
    /// The file says something that cannot be.
    #[error("{file}:{line}: {problem}")]
    Invalid {
        /// The file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// What is wrong.
        problem: Box<LayoutProblem>,
    },
}

/// What is wrong in a layout file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LayoutProblem {
    /// Not TOML, an unknown or missing key, or a value of the wrong type.
    #[error("{0}")]
    Syntax(String),
    /// A list or number outside its limits.
    #[error("{what} is {value}, and must be {min} to {max}")]
    OutOfRange {
        /// Name of the quantity.
        what: &'static str,
        /// The value given.
        value: i64,
        /// Smallest allowed value.
        min: i64,
        /// Largest allowed value.
        max: i64,
    },
    /// An image with too many pixels.
    #[error("an image of {width} x {height} is more than {MAX_PIXELS} pixels")]
    TooManyPixels {
        /// Width, pixels.
        width: i64,
        /// Height, pixels.
        height: i64,
    },
    /// A name that must not be empty, not have control characters, or not be used twice.
    #[error("{what} {name:?} is {why}")]
    BadName {
        /// What is named.
        what: &'static str,
        /// The name.
        name: String,
        /// `empty`, `used twice`, or what it has.
        why: &'static str,
    },
    /// A module on a bus that the file does not list.
    #[error("module {module:?} is on bus {bus:?}, but the buses are {known}")]
    UnknownBus {
        /// The module.
        module: String,
        /// The bus it names.
        bus: String,
        /// The buses listed.
        known: String,
    },
    /// A protocol that no decoder knows.
    #[error(
        "module {module:?}: unknown board protocol {protocol:?}; known are {}",
        Protocol::names()
    )]
    UnknownProtocol {
        /// The module.
        module: String,
        /// The protocol it names.
        protocol: String,
    },
    /// An address that the protocol cannot express.
    #[error("module {module:?}: board {board} is out of range, {} has boards {} to {}",
        protocol.name(), protocol.addresses().start, protocol.addresses().end - 1)]
    BoardOutOfRange {
        /// The module.
        module: String,
        /// The address given.
        board: i64,
        /// Its protocol.
        protocol: Protocol,
    },
    /// Two modules claim one board.
    #[error(
        "module {module:?} has board {board} on bus {bus:?}, which module {other:?} (line {other_line}) already has"
    )]
    SameBoard {
        /// The second module.
        module: String,
        /// The bus.
        bus: String,
        /// The address.
        board: u8,
        /// The first module.
        other: String,
        /// Its line, from 1.
        other_line: usize,
    },
    /// Taxels of two boards would be sent under one id.
    #[error(
        "taxel k = {k} of module {module:?} has CAN id {id:#05X} on bus {bus:?}, and so has taxel k = {other_k} of module {other:?} (line {other_line})"
    )]
    SameCanId {
        /// The second module.
        module: String,
        /// Its taxel.
        k: u16,
        /// The bus.
        bus: String,
        /// The id.
        id: u16,
        /// The first module.
        other: String,
        /// Its taxel.
        other_k: u16,
        /// Its line, from 1.
        other_line: usize,
    },
    /// A rotation that does not map pixels to pixels.
    #[error(
        "module {module:?}: rotation {degrees} is impossible, write 0, 90, 180 or 270 (degrees, clockwise)"
    )]
    Rotation {
        /// The module.
        module: String,
        /// The rotation given.
        degrees: i64,
    },
    /// A protocol whose boards have no order to assume.
    #[error("module {module:?}: where the taxels of {} modules lie is not known without being told, so `order` must be written", protocol.name())]
    OrderNeeded {
        /// The module.
        module: String,
        /// Its protocol.
        protocol: Protocol,
    },
    /// An order table that is not a rectangle.
    #[error("module {module:?}: row {row} of its order has {columns} cells and the first has {expected}")]
    OrderNotRectangular {
        /// The module.
        module: String,
        /// The row, from 0.
        row: usize,
        /// Its cells.
        columns: usize,
        /// Cells of the first row.
        expected: usize,
    },
    /// A number in the order table that is no taxel of the board.
    #[error("module {module:?}: its order has taxel {k}, but the taxels of {} are 0 to {}; -1 is an empty cell",
        protocol.name(), protocol.taxel_numbers() - 1)]
    OrderOutOfRange {
        /// The module.
        module: String,
        /// The number given.
        k: i64,
        /// Its protocol.
        protocol: Protocol,
    },
    /// A taxel that is in the order table twice.
    #[error("module {module:?}: its order has taxel {k} twice, in rows {first_row} and {row}")]
    OrderRepeats {
        /// The module.
        module: String,
        /// The taxel.
        k: u16,
        /// The first row, from 0.
        first_row: usize,
        /// The second row, from 0.
        row: usize,
    },
    /// An order table without any taxel.
    #[error("module {module:?}: its order has no taxel")]
    OrderEmpty {
        /// The module.
        module: String,
    },
    /// An order without an empty cell whose numbers begin with 1.
    #[error(
        "module {module:?}: its order has the taxels 1 to {taxels}, and taxels are counted from 0: write one less for each, \
         or where there is no taxel 0, -1 in its place"
    )]
    OrderFromOne {
        /// The module.
        module: String,
        /// How many taxels it has.
        taxels: usize,
    },
    /// A taxel outside the image.
    #[error(
        "taxel k = {k} of module {module:?} is at pixel ({x}, {y}), outside the image of {width} x {height}"
    )]
    OutsideImage {
        /// The module.
        module: String,
        /// The taxel.
        k: u16,
        /// Column.
        x: i64,
        /// Row.
        y: i64,
        /// Width of the image.
        width: u16,
        /// Height of the image.
        height: u16,
    },
    /// Two taxels on one pixel.
    #[error(
        "taxel k = {k} of module {module:?} is at pixel ({x}, {y}), and so is taxel k = {other_k} of module {other:?} (line {other_line})"
    )]
    Overlap {
        /// The second module.
        module: String,
        /// Its taxel.
        k: u16,
        /// Column.
        x: u16,
        /// Row.
        y: u16,
        /// The first module.
        other: String,
        /// Its taxel.
        other_k: u16,
        /// Its line, from 1.
        other_line: usize,
    },
    /// A number in the order table that is a thermal pad or the temperature.
    #[error(
        "module {module:?}: its order has {k}, which measures temperature and is no taxel; write -1 there"
    )]
    NotATaxel {
        /// The module.
        module: String,
        /// The number given.
        k: u16,
    },
    /// A key that this protocol needs, or that it has no use for.
    #[error("module {module:?}: {} {problem}", protocol.name())]
    Key {
        /// The module.
        module: String,
        /// Its protocol.
        protocol: Protocol,
        /// Which key, and what is wrong.
        problem: String,
    },
    /// The table `cyskin` is missing, incomplete or contradictory.
    #[error("{0}")]
    Cyskin(String),
    /// More taxels than can be numbered.
    #[error("with module {module:?} the layout has {taxels} taxels, more than {MAX_TAXELS}")]
    TooManyTaxels {
        /// The module.
        module: String,
        /// Taxels up to and including it.
        taxels: usize,
    },
    /// Positions given in a way that does not add up.
    #[error("module {module:?}: {why}")]
    Positions {
        /// The module.
        module: String,
        /// What does not add up.
        why: String,
    },
    /// A pose that is none, or a joint without a name.
    #[error("module {module:?}: {why}")]
    Place {
        /// The module.
        module: String,
        /// What is wrong.
        why: String,
    },
}
