//! The kinds of problems, and how much each matters.

use std::fmt;

/// How much a problem matters to who wears the display.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// It works, but not as it should, or not for long.
    Warning,
    /// Taxels or joint angles are wrong or missing now, or a motor cannot be trusted.
    Error,
}

macro_rules! kinds {
    ($($(#[$doc:meta])* $kind:ident $name:literal $severity:ident,)*) => {
        /// What kind of problem it is.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Kind { $($(#[$doc])* $kind,)* }

        impl Kind {
            /// Every kind.
            pub const ALL: &[Kind] = &[$(Kind::$kind,)*];

            /// The stable name that programs go by.
            pub const fn name(self) -> &'static str {
                match self { $(Kind::$kind => $name,)* }
            }

            /// How much it matters: the same wherever it is told.
            pub const fn severity(self) -> Severity {
                match self { $(Kind::$kind => Severity::$severity,)* }
            }
        }
    };
}

kinds! {
    /// There is no interface of a bus.
    LinkAbsent "link-absent" Error,
    /// The interface of a bus is down.
    LinkDown "link-down" Error,
    /// A recording in the place of a bus is at its end.
    RecordingEnded "recording-ended" Warning,
    /// A controller is off its bus.
    BusOff "bus-off" Error,
    /// A controller changes its error state again and again.
    Flapping "flapping" Warning,
    /// A controller sees many errors.
    ErrorWarning "error-warning" Warning,
    /// A controller sees so many errors that it may no longer say so.
    ErrorPassive "error-passive" Warning,
    /// Frames are broken.
    BusErrors "bus-errors" Warning,
    /// Nobody acknowledges what is sent.
    NoAcknowledge "no-acknowledge" Warning,
    /// Commands do not get onto a bus.
    CannotSend "cannot-send" Warning,
    /// An adapter drops frames.
    ControllerOverflow "controller-overflow" Warning,
    /// The kernel drops frames.
    FramesLost "frames-lost" Warning,
    /// What comes over a bus is no CAN frame.
    Undecodable "undecodable" Warning,
    /// What is sent to the socket of a pressure array is refused.
    ArrayRefused "array-refused" Warning,
    /// Frames of a pressure array do not come.
    ArrayLost "array-lost" Warning,
    /// Frames of a pressure array come long after they were measured.
    ArrayLate "array-late" Warning,
    /// Two programs send frames of one pressure array.
    ArraySenders "array-senders" Error,
    /// Another program reads a bus, or tells its boards what to do.
    BusShared "bus-shared" Warning,
    /// No board of a bus speaks.
    BusSilent "bus-silent" Error,
    /// A board was never heard.
    BoardUnheard "board-unheard" Error,
    /// A board is heard no longer.
    BoardSilent "board-silent" Error,
    /// Frames of a board come and cannot be read.
    BoardMalformed "board-malformed" Error,
    /// A board falls silent again and again.
    BoardUnsteady "board-unsteady" Warning,
    /// An identifier takes a bus from others. Boards that it starves are told as silent.
    Babbling "babbling" Warning,
    /// A board sends far too many sweeps. Boards that it starves are told as silent.
    BoardBabbling "board-babbling" Warning,
    /// Two boards answer under one address, so that its taxels are now of the one, now of the other.
    TwoBoards "two-boards-one-address" Error,
    /// Two buses are swapped, so that the wrong fingers feel.
    BusesSwapped "buses-swapped" Error,
    /// A board is on another bus than the layout says.
    BoardOnOtherBus "board-on-other-bus" Error,
    /// A board is not in the layout.
    BoardNotInLayout "board-not-in-layout" Warning,
    /// More than a quarter of a module's taxels feel nothing, though its board speaks.
    TaxelsOutOfUse "taxels-out-of-use" Error,
    /// The hand moved, or was touched, while its baseline was measured.
    BaselineMoved "baseline-moved" Warning,
    /// Taxels are in contact without a change for minutes.
    ContactUnchanging "contact-unchanging" Warning,
    /// The servos' port cannot be opened.
    SerialAbsent "serial-absent" Error,
    /// The thread that reads servos hangs in a call of their port's driver, or has panicked.
    SerialStuck "serial-stuck" Error,
    /// Another program takes the servos' answers out of their port.
    SerialShared "serial-shared" Error,
    /// The servos' adapter keeps answers back.
    AdapterLatency "adapter-latency" Warning,
    /// No servo answers.
    ServosSilent "servos-silent" Error,
    /// One servo does not answer.
    ServoSilent "servo-silent" Error,
    /// Answers come too late.
    ServoLate "servo-late" Warning,
    /// Answers come damaged.
    ServoDamaged "servo-damaged" Warning,
    /// Two servos answer with one id.
    TwoServos "two-servos-one-id" Error,
    /// A servo answers, and refuses to be read.
    ServoRefuses "servo-refuses" Error,
    /// A servo is of a model that is not known.
    ServoModel "servo-model" Warning,
    /// A servo has switched its motor off.
    ServoError "servo-error" Error,
    /// A servo is about to switch its motor off.
    ServoHot "servo-hot" Warning,
    /// A motor was told to be off, and its servo has not confirmed it.
    MotorNotOff "motor-not-off" Error,
    /// A motor that is on was stopped by its servo's bus watchdog.
    MotorStopped "motor-stopped" Error,
    /// A motor that was switched on here is so no longer, without being told to.
    MotorLost "motor-lost" Error,
    /// The port of the potentiometers cannot be opened.
    AnalogueAbsent "analogue-absent" Error,
    /// No line comes from the potentiometers.
    AnalogueSilent "analogue-silent" Error,
    /// Lines of the potentiometers cannot be read.
    AnalogueMalformed "analogue-malformed" Warning,
    /// One potentiometer gives no angle.
    PotentiometerLost "potentiometer-lost" Error,
    /// A joint's angle is unknown, and nothing else says why.
    JointStale "joint-stale" Error,
    /// An Allegro hand sends no angles.
    HandSilent "hand-silent" Error,
    /// A finger of an Allegro hand sends no angles.
    FingerSilent "finger-silent" Error,
    /// An Allegro hand reports an error of one of its motors.
    HandError "hand-error" Error,
    /// The angles of an Allegro hand cannot be those of the version given.
    HandVersion "hand-version" Warning,
    /// The daemon was told to read its configuration again, and cannot take it up.
    ReloadRefused "reload-refused" Warning,
    /// Sockets of the daemon were removed or replaced: nobody can switch a motor off or be shown images any more.
    SocketsLost "sockets-lost" Error,
    /// Clients that want to see images are turned away.
    ReadersTurnedAway "readers-turned-away" Warning,
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
