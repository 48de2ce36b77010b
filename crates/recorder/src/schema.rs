//! What is recorded under which topic, and the definition of each message.

/// What a recording has messages of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Topic {
    /// Raw CAN, many frames to a message.
    Can,
    /// Every taxel's counts, and what conditioning made of them.
    Frames,
    /// Tactile images with everything about them.
    Images,
    /// The pixels of the images, for viewers.
    Picture,
    /// Joint angles.
    Joints,
    /// What is wrong.
    Diagnostics,
    /// What was told to people, marks among it.
    Events,
    /// Description of hand and display, JSON.
    Hello,
    /// The daemon's status reports, JSON.
    Status,
    /// Both clocks at one instant.
    Clock,
}

/// A topic's name, the name of its messages' type, and their definition as ROS 2 writes it.
pub(crate) struct Schema {
    pub(crate) topic: &'static str,
    pub(crate) type_name: &'static str,
    pub(crate) text: &'static str,
}

impl Topic {
    /// Every topic.
    pub const ALL: [Self; 10] = [
        Self::Can,
        Self::Frames,
        Self::Images,
        Self::Picture,
        Self::Joints,
        Self::Diagnostics,
        Self::Events,
        Self::Hello,
        Self::Status,
        Self::Clock,
    ];

    /// Its name in a file, such as `/taxel/can`.
    pub fn name(self) -> &'static str {
        self.schema().topic
    }

    /// The name of its messages' type, such as `sensor_msgs/msg/Image`.
    pub fn type_name(self) -> &'static str {
        self.schema().type_name
    }

    /// The definition of its messages and of what they hold, as ROS 2 writes it (`ros2msg`).
    pub fn definition(self) -> &'static str {
        self.schema().text
    }

    pub(crate) fn schema(self) -> Schema {
        let (topic, type_name, text) = match self {
            Self::Can => ("/taxel/can", "taxel_msgs/msg/CanFrames", CAN_FRAMES),
            Self::Frames => ("/taxel/frames", "taxel_msgs/msg/TactileFrame", TACTILE_FRAME),
            Self::Images => ("/taxel/images", "taxel_msgs/msg/TactileImage", TACTILE_IMAGE),
            Self::Picture => ("/tactile_image", "sensor_msgs/msg/Image", IMAGE),
            Self::Joints => ("/joint_states", "sensor_msgs/msg/JointState", JOINT_STATE),
            Self::Diagnostics => (
                "/diagnostics",
                "diagnostic_msgs/msg/DiagnosticArray",
                DIAGNOSTIC_ARRAY,
            ),
            Self::Events => ("/rosout", "rcl_interfaces/msg/Log", LOG),
            Self::Hello => ("/taxel/hello", "std_msgs/msg/String", STRING),
            Self::Status => ("/taxel/status", "std_msgs/msg/String", STRING),
            Self::Clock => ("/taxel/clock", "taxel_msgs/msg/Clocks", CLOCKS),
        };
        Schema {
            topic,
            type_name,
            text,
        }
    }
}

const CAN_FRAMES: &str = "\
# CAN frames in the order of their times. Frame i is element i of after_ns, bus, id and length, and bytes 8*i.. of data.
string[] buses     # their names
uint64[] lost      # of each bus, frames that the kernel dropped, or for which the disk was too slow, since the recorder began
uint64 start_ns    # CLOCK_MONOTONIC
uint32[] after_ns  # received at start_ns + after_ns[i]
uint8[] bus        # index into buses
uint32[] id        # with the flags of linux/can.h: 0x80000000 extended, 0x40000000 remote, 0x20000000 error
uint8[] length     # bytes of data, 0 to 8
uint8[] data       # 8 bytes per frame, zeros behind its length
";

const TACTILE_FRAME: &str = "\
# Every taxel as its board sent it, what conditioning made of it, and the joints: taxeld's RAW message.
uint64 seq                # number of the frame since the daemon started
uint64 t_ns               # time of validity, on the clock that /taxel/hello names
uint16 flags              # of the message's header
uint32 skipped            # frames that the recorder was not given before this one
float32 threshold         # contact threshold
uint16[] counts           # x, y, z of each taxel
uint16[] faults           # bits, 0 where the taxel is used
float32[] force           # magnitude above baseline
uint32[] age_us           # of the value at t_ns; 4294967295 where there is none
uint8[] freshness         # 0 no value ever came, 1 stale, 2 of this frame
uint8[] status            # status byte of the board
uint8[] marks             # bit 0: in contact, bit 1: repaired
float32[] joints          # radians
uint32[] joint_ages_us    # empty where unknown, as are the following
float32[] joint_velocities
float32[] joint_currents
float32[] baselines       # x, y, z of each taxel at rest
";

const TACTILE_IMAGE: &str = "\
# A tactile image: taxeld's IMAGE message.
uint64 seq                # number of the frame since the daemon started
uint64 t_ns               # time of validity, on the clock that /taxel/hello names
uint16 flags              # of the message's header
uint32 skipped            # images that the recorder was not given before this one
uint16 width
uint16 height
uint32 contacts
uint32 faulty
uint32 missing
float32[] levels          # force of levels 1, 2, ..
uint16[] actuator_id      # actuator i is element i of these five
uint16[] actuator_x
uint16[] actuator_y
uint16[] actuator_level
float32[] actuator_force
float32[] joints          # radians
uint8[] pixels            # row by row
";

const CLOCKS: &str = "\
# Both clocks at one instant.
uint64 monotonic_ns  # CLOCK_MONOTONIC
uint64 realtime_ns   # CLOCK_REALTIME, since 1970
";

const STRING: &str = "string data\n";

macro_rules! with_header {
    ($fields:literal $(, $more:literal)?) => {
        concat!(
            "std_msgs/Header header\n", $fields,
            "================================================================================\n\
             MSG: std_msgs/Header\n\
             builtin_interfaces/Time stamp\n\
             string frame_id\n\
             ================================================================================\n\
             MSG: builtin_interfaces/Time\n\
             int32 sec\n\
             uint32 nanosec\n",
            $($more)?
        )
    };
}

const IMAGE: &str = with_header!(
    "uint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data\n"
);

const JOINT_STATE: &str =
    with_header!("string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n");

const DIAGNOSTIC_ARRAY: &str = with_header!(
    "diagnostic_msgs/DiagnosticStatus[] status\n",
    "================================================================================\n\
     MSG: diagnostic_msgs/DiagnosticStatus\n\
     byte OK=0\n\
     byte WARN=1\n\
     byte ERROR=2\n\
     byte STALE=3\n\
     byte level\n\
     string name\n\
     string message\n\
     string hardware_id\n\
     diagnostic_msgs/KeyValue[] values\n\
     ================================================================================\n\
     MSG: diagnostic_msgs/KeyValue\n\
     string key\n\
     string value\n"
);

const LOG: &str = "\
byte DEBUG=10
byte INFO=20
byte WARN=30
byte ERROR=40
byte FATAL=50
builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
";
