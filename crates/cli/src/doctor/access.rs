//! What this user may open: the daemon's sockets and the serial port of the servos, and how fast
//! that port is.

use super::finding::Check;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};
use taxel_diagnose::slow_adapter;

/// Who runs the doctor.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct User {
    pub(super) uid: u32,
    pub(super) groups: Vec<u32>,
}

impl User {
    /// From `/proc/self/status`.
    pub(super) fn read(root: &Path) -> Self {
        let status = std::fs::read_to_string(root.join("proc/self/status")).unwrap_or_default();
        let numbers = |key: &str| -> Vec<u32> {
            let line = status.lines().find_map(|line| line.strip_prefix(key));
            line.unwrap_or("")
                .split_whitespace()
                .filter_map(|n| n.parse().ok())
                .collect()
        };
        let mut groups = numbers("Groups:");
        // Real, effective, saved, file system.
        groups.extend(numbers("Gid:").get(1));
        Self {
            uid: numbers("Uid:").get(1).copied().unwrap_or(u32::MAX),
            groups,
        }
    }

    /// Whether the permissions of a file allow this user to read and write it.
    pub(super) fn may_use(&self, file: &FileFacts) -> bool {
        let allowed = if file.uid == self.uid {
            file.mode >> 6
        } else if self.groups.contains(&file.gid) {
            file.mode >> 3
        } else {
            file.mode
        };
        self.uid == 0 || allowed & 0o6 == 0o6
    }
}

/// Owner and permissions of a file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FileFacts {
    pub(super) uid: u32,
    pub(super) gid: u32,
    pub(super) mode: u32,
    /// Name of its group, where it has one.
    pub(super) group: String,
}

impl FileFacts {
    pub(super) fn read(root: &Path, path: &Path) -> Option<Self> {
        let meta = std::fs::metadata(path).ok()?;
        let groups = std::fs::read_to_string(root.join("etc/group")).unwrap_or_default();
        let name = groups.lines().find_map(|line| {
            let mut fields = line.split(':');
            let name = fields.next()?;
            (fields.nth(1)?.parse::<u32>().ok()? == meta.gid()).then(|| name.to_string())
        });
        Some(Self {
            uid: meta.uid(),
            gid: meta.gid(),
            mode: meta.mode() & 0o777,
            group: name.unwrap_or_else(|| meta.gid().to_string()),
        })
    }
}

impl FileFacts {
    /// The command after which a user may use it, where a group may.
    pub(super) fn join_its_group(&self) -> Option<String> {
        let by_group = self.gid != 0 && self.mode >> 3 & 0o6 == 0o6;
        by_group.then(|| format!("sudo usermod -aG {} $USER    # then log in anew", self.group))
    }
}

/// The port of the servos.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PortFacts {
    /// As the configuration names it.
    pub(super) path: PathBuf,
    /// What it leads to; `None` where there is nothing.
    pub(super) device: Option<PathBuf>,
    pub(super) is_terminal: bool,
    pub(super) file: Option<FileFacts>,
    /// An FTDI adapter's latency timer, ms; `None` for others.
    pub(super) latency_ms: Option<u32>,
    /// The name under `/dev/serial/by-id` that leads to the same device.
    pub(super) stable_name: Option<PathBuf>,
    /// The names under `/dev/serial/by-id`.
    pub(super) others: Vec<PathBuf>,
}

impl PortFacts {
    pub(super) fn read(root: &Path, path: &Path) -> Self {
        let device = std::fs::canonicalize(path).ok();
        let mut others: Vec<PathBuf> = std::fs::read_dir(root.join("dev/serial/by-id"))
            .into_iter()
            .flatten()
            .flatten()
            .map(|entry| entry.path())
            .collect();
        others.sort();
        let stable_name = others
            .iter()
            .find(|link| device.is_some() && std::fs::canonicalize(link).ok() == device)
            .cloned();
        let latency = device.as_ref().and_then(|device| {
            let name = device.file_name()?;
            let devices = root.join("sys/bus/usb-serial/devices");
            std::fs::read_to_string(devices.join(name).join("latency_timer")).ok()
        });
        Self {
            path: path.into(),
            is_terminal: device
                .as_ref()
                .and_then(|d| std::fs::metadata(d).ok())
                .is_some_and(|m| m.file_type().is_char_device()),
            file: device.as_ref().and_then(|d| FileFacts::read(root, d)),
            latency_ms: latency.and_then(|text| text.trim().parse().ok()),
            device,
            stable_name,
            others,
        }
    }
}

/// What is to be said of the port before anything is asked of the servos.
pub(super) fn check_port(facts: &PortFacts, user: &User) -> Vec<Check> {
    const AREA: &str = "servos";
    let path = facts.path.display().to_string();
    let Some(device) = &facts.device else {
        let names: Vec<String> = facts.others.iter().map(|p| p.display().to_string()).collect();
        let there = match names.is_empty() {
            true => "no USB serial adapter is plugged in".to_string(),
            false => format!("there is: {}", names.join(", ")),
        };
        return vec![Check::error(AREA, "port", path, "does not exist").advise(format!(
            "plug the adapter in and see `ls -l /dev/serial/by-id`; {there}"
        ))];
    };
    if !facts.is_terminal {
        return vec![Check::error(AREA, "port", path, "is no serial port")];
    }
    let name = device.file_name().unwrap_or_default().to_string_lossy();
    let mut checks = Vec::new();
    match &facts.file {
        Some(file) if !user.may_use(file) => {
            let found = format!(
                "belongs to group {} (mode {:o}), which this user is not in",
                file.group, file.mode
            );
            let check = Check::error(AREA, "port", &path, found);
            checks.push(match (file.join_its_group(), name.trim_end_matches(char::is_numeric)) {
                (Some(command), _) => check.run(command),
                // One end of a pseudo terminal, which udev has no say in.
                (None, "") => check.advise("its owner alone may use it: run the doctor as that user"),
                (None, kind) => check
                    .run(format!(
                        "echo 'SUBSYSTEM==\"tty\", KERNEL==\"{kind}*\", GROUP=\"dialout\", MODE=\"0660\"' \
                         | sudo tee /etc/udev/rules.d/60-taxeld-port.rules"
                    ))
                    .run("sudo udevadm control --reload && sudo udevadm trigger --subsystem-match=tty")
                    .run("sudo usermod -aG dialout $USER    # then log in anew"),
            });
        }
        _ => checks.push(Check::ok(AREA, "port", &path, "may be opened")),
    }
    if let Some(stable) = &facts.stable_name
        && *stable != facts.path
    {
        checks.push(
            Check::warning(
                AREA,
                "port name",
                &path,
                "is numbered anew each time the adapter is plugged in",
            )
            .wanted(format!("source = \"dynamixel:{}\"", stable.display())),
        );
    }
    if let Some(ms) = facts.latency_ms {
        checks.push(match slow_adapter(ms, &name) {
            None => Check::ok(AREA, "FTDI latency", &path, format!("{ms} ms")),
            Some(problem) => Check::of_problem(AREA, &path, &problem)
                .without_mend()
                .run(format!("echo 1 | sudo tee /sys/bus/usb-serial/devices/{name}/latency_timer"))
                .run(
                    "echo 'ACTION!=\"remove\", SUBSYSTEM==\"usb-serial\", DRIVER==\"ftdi_sio\", ATTR{latency_timer}=\"1\"' \
                     | sudo tee /etc/udev/rules.d/60-taxeld-ftdi.rules    # for good",
                )
                .advise("taxeld also asks the driver for low latency when it opens the port, which sets it for that time"),
        });
    }
    checks
}

#[cfg(test)]
mod tests {
    use super::super::finding::{Mend, State};
    use super::*;

    fn user(uid: u32, groups: &[u32]) -> User {
        User {
            uid,
            groups: groups.into(),
        }
    }

    fn port(change: impl FnOnce(&mut PortFacts)) -> PortFacts {
        let mut facts = PortFacts {
            path: "/dev/serial/by-id/usb-FTDI".into(),
            device: Some("/dev/ttyUSB0".into()),
            is_terminal: true,
            file: Some(FileFacts {
                uid: 0,
                gid: 20,
                mode: 0o660,
                group: "dialout".into(),
            }),
            latency_ms: Some(1),
            stable_name: Some("/dev/serial/by-id/usb-FTDI".into()),
            others: vec!["/dev/serial/by-id/usb-FTDI".into()],
        };
        change(&mut facts);
        facts
    }

    #[test]
    fn permissions_are_those_of_owner_group_and_others() {
        let file = |mode| FileFacts {
            uid: 5,
            gid: 20,
            mode,
            group: "g".into(),
        };
        for (mode, uid, groups, may) in [
            (0o660, 5, &[][..], true),
            (0o660, 6, &[20], true),
            (0o660, 6, &[21], false),
            (0o666, 6, &[], true),
            (0o066, 5, &[20], false),
            (0o000, 0, &[], true),
            (0o640, 6, &[20], false),
        ] {
            assert_eq!(
                user(uid, groups).may_use(&file(mode)),
                may,
                "{mode:o} {uid} {groups:?}"
            );
        }
    }

    #[test]
    fn a_port_is_found_fault_with_in_words_and_commands() {
        let member = user(1000, &[20]);
        assert!(
            check_port(&port(|_| {}), &member)
                .iter()
                .all(|c| c.state == State::Ok)
        );
        for (facts, user, name, state, mend) in [
            (
                port(|f| f.latency_ms = Some(16)),
                &member,
                "adapter-latency",
                State::Warning,
                "echo 1 | sudo tee /sys/bus/usb-serial/devices/ttyUSB0/latency_timer",
            ),
            (
                port(|_| {}),
                &user(1000, &[]),
                "port",
                State::Error,
                "sudo usermod -aG dialout $USER",
            ),
            (
                port(|f| (f.file.as_mut().unwrap().gid, f.file.as_mut().unwrap().group) = (0, "root".into())),
                &member,
                "port",
                State::Error,
                "echo 'SUBSYSTEM==\"tty\", KERNEL==\"ttyUSB*\", GROUP=\"dialout\", MODE=\"0660\"' | sudo tee",
            ),
            (
                port(|f| {
                    f.device = Some("/dev/pts/3".into());
                    f.file.as_mut().unwrap().mode = 0o600;
                }),
                &member,
                "port",
                State::Error,
                "its owner alone may use it",
            ),
            (
                port(|f| f.device = None),
                &member,
                "port",
                State::Error,
                "plug the adapter in",
            ),
        ] {
            let checks = check_port(&facts, user);
            let check = checks.iter().find(|c| c.name == name).unwrap();
            assert_eq!(check.state, state);
            let (Mend::Run(text) | Mend::Do(text)) = &check.mend[0];
            assert!(text.starts_with(mend), "{text}");
        }
        let numbered = check_port(&port(|f| f.path = "/dev/ttyUSB0".into()), &member);
        assert_eq!(
            numbered[1].wanted,
            "source = \"dynamixel:/dev/serial/by-id/usb-FTDI\""
        );
    }

    #[test]
    fn the_user_is_read_as_the_kernel_writes_it() {
        let root = tempfile::TempDir::new().unwrap();
        std::fs::create_dir(root.path().join("proc")).unwrap();
        std::fs::create_dir(root.path().join("proc/self")).unwrap();
        let status =
            "Name:\ttaxel\nUid:\t1000\t1001\t1001\t1001\nGid:\t100\t101\t101\t101\nGroups:\t20 27 \n";
        std::fs::write(root.path().join("proc/self/status"), status).unwrap();
        assert_eq!(User::read(root.path()), user(1001, &[20, 27, 101]));
    }

    #[test]
    fn the_latency_timer_and_the_stable_name_are_found() {
        let root = tempfile::TempDir::new().unwrap();
        let at = |path: &str| root.path().join(path);
        std::fs::create_dir_all(at("dev/serial/by-id")).unwrap();
        std::fs::create_dir_all(at("sys/bus/usb-serial/devices/ttyUSB3")).unwrap();
        std::fs::write(at("dev/ttyUSB3"), "").unwrap();
        std::fs::write(at("sys/bus/usb-serial/devices/ttyUSB3/latency_timer"), "16\n").unwrap();
        std::os::unix::fs::symlink(at("dev/ttyUSB3"), at("dev/serial/by-id/usb-X")).unwrap();
        let facts = PortFacts::read(root.path(), &at("dev/ttyUSB3"));
        assert_eq!(facts.latency_ms, Some(16));
        assert_eq!(facts.stable_name, Some(at("dev/serial/by-id/usb-X")));
        assert!(!facts.is_terminal, "a plain file");
        assert_eq!(PortFacts::read(root.path(), &at("dev/none")).device, None);
    }
}
