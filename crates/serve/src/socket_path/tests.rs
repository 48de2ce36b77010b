use super::*;
use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
use std::os::unix::net::{UnixDatagram, UnixListener, UnixStream};

fn take(path: &Path) -> Result<SocketPath, SocketPathError> {
    SocketPath::take(path, 0o660, "")
}

fn mode(path: &Path) -> u32 {
    fs::symlink_metadata(path).unwrap().mode() & 0o7777
}

#[test]
fn a_stale_socket_is_replaced() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("images.sock");
    drop(UnixListener::bind(&path).unwrap());
    assert!(path.exists(), "a dropped listener leaves its file behind");
    let mut taken = take(&path).unwrap();
    let _listener = taken.listen(SockType::Stream, 8).unwrap();
    UnixStream::connect(&path).unwrap();
}

#[test]
fn a_living_daemon_keeps_its_socket() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("images.sock");
    let mut held = take(&path).unwrap();
    let _listener = held.listen(SockType::SeqPacket, 8).unwrap();
    assert!(matches!(take(&path), Err(SocketPathError::InUse { .. })));
    assert!(path.exists());
}

#[test]
fn what_another_program_listens_on_is_left_alone_whatever_its_type() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let _stream = UnixListener::bind(path("stream")).unwrap();
    let _datagram = UnixDatagram::bind(path("datagram")).unwrap();
    let packets = socket(AddressFamily::Unix, SockType::SeqPacket, SockFlag::empty(), None).unwrap();
    bind(packets.as_raw_fd(), &UnixAddr::new(&path("packets")).unwrap()).unwrap();
    listen(&packets, Backlog::new(1).unwrap()).unwrap();
    for name in ["stream", "datagram", "packets"] {
        let error = take(&path(name)).unwrap_err();
        assert!(
            matches!(error, SocketPathError::Foreign { .. }),
            "{name}: {error}"
        );
        assert!(path(name).exists(), "{name}");
        let lock = format!("{name}.lock");
        assert!(!path(&lock).exists(), "{lock} is left behind");
    }
}

#[test]
fn what_is_no_socket_is_left_alone_be_it_a_file_or_a_link_to_a_socket() {
    let dir = tempfile::tempdir().unwrap();
    let (file, link, stale) = (
        dir.path().join("file"),
        dir.path().join("link"),
        dir.path().join("stale"),
    );
    fs::write(&file, "precious").unwrap();
    drop(UnixListener::bind(&stale).unwrap());
    symlink(&stale, &link).unwrap();
    for path in [&file, &link] {
        assert!(matches!(take(path), Err(SocketPathError::NotASocket { .. })));
    }
    assert_eq!(fs::read(&file).unwrap(), b"precious");
    assert!(link.is_symlink() && stale.exists());
}

#[test]
fn a_lock_file_that_is_not_ours_alone_is_refused_and_nothing_behind_it_is_touched() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("file");
    fs::write(&file, "precious").unwrap();
    fs::set_permissions(&file, fs::Permissions::from_mode(0o644)).unwrap();
    let at = |name: &str| dir.path().join(format!("{name}.lock"));
    symlink(&file, at("link")).unwrap();
    symlink(dir.path().join("nothing"), at("dangling")).unwrap();
    fs::hard_link(&file, at("hard")).unwrap();
    nix::unistd::mkfifo(&at("pipe"), Mode::S_IRWXU).unwrap();
    fs::create_dir(at("folder")).unwrap();
    let mut names = vec!["link", "dangling", "hard", "pipe", "folder"];
    // Only root can make a file another user's.
    if nix::unistd::geteuid().is_root() {
        fs::write(at("foreign"), "").unwrap();
        std::os::unix::fs::chown(at("foreign"), Some(65534), None).unwrap();
        names.push("foreign");
    }
    for name in names {
        let error = take(&dir.path().join(name)).unwrap_err();
        assert!(
            matches!(error, SocketPathError::ForeignLock { .. }),
            "{name}: {error}"
        );
    }
    assert_eq!(
        (fs::read(&file).unwrap().as_slice(), mode(&file)),
        (&b"precious"[..], 0o644)
    );
    assert!(!dir.path().join("nothing").exists());
}

#[test]
fn nobody_else_can_open_the_lock_file_even_one_of_an_earlier_version() {
    let dir = tempfile::tempdir().unwrap();
    let lock = dir.path().join("images.sock.lock");
    fs::write(&lock, "").unwrap();
    fs::set_permissions(&lock, fs::Permissions::from_mode(0o644)).unwrap();
    let _taken = take(&dir.path().join("images.sock")).unwrap();
    assert_eq!(mode(&lock), 0o600);
}

#[test]
fn a_socket_has_the_mode_that_is_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    for wanted in [0o600, 0o660, 0o666] {
        let path = dir.path().join("images.sock");
        let mut taken = SocketPath::take(&path, wanted, "").unwrap();
        let _listener = taken.listen(SockType::Stream, 8).unwrap();
        assert_eq!(mode(&path), wanted);
    }
}

#[test]
fn a_socket_is_its_owners_alone_until_it_has_its_group_and_mode() {
    let dir = tempfile::tempdir().unwrap();
    for (name, kind) in [
        ("images.sock", SockType::SeqPacket),
        ("wire.sock", SockType::Datagram),
    ] {
        let path = dir.path().join(name);
        let _bound = bind_private(&path, kind).unwrap();
        assert_eq!(mode(&path), 0o600, "{name}");
    }
}

#[test]
fn the_socket_its_lock_and_folders_go_with_their_owner_and_the_path_is_free_again() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("deep/er/images.sock");
    for _ in 0..2 {
        let mut taken = take(&path).unwrap();
        let listener = taken.listen(SockType::Stream, 8).unwrap();
        assert_eq!(mode(path.parent().unwrap()) & 0o022, 0);
        drop((taken, listener));
        assert!(!dir.path().join("deep").exists());
    }
    // What else is in a folder is left there with it.
    let taken = take(&path).unwrap();
    fs::write(path.with_file_name("notes"), "").unwrap();
    drop(taken);
    assert!(path.with_file_name("notes").exists());
}

#[test]
fn an_ending_owner_leaves_the_socket_and_lock_of_another_one_alone() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("taxeld/images.sock");
    let folder = path.parent().unwrap();
    let mut first = take(&path).unwrap();
    let first_listener = first.listen(SockType::SeqPacket, 8).unwrap();
    // As `rm -r` does, upon which another daemon can start.
    fs::remove_dir_all(folder).unwrap();
    let mut second = take(&path).unwrap();
    let second_listener = second.listen(SockType::SeqPacket, 8).unwrap();
    drop((first, first_listener));
    assert!(path.exists() && folder.join("images.sock.lock").exists());
    assert!(matches!(take(&path), Err(SocketPathError::InUse { .. })));
    drop((second, second_listener));
    assert!(!folder.exists());
}

#[test]
fn a_path_that_somebody_has_spoilt_is_taken_again_and_stays_with_one_daemon() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("taxeld/images.sock");
    let folder = path.parent().unwrap();
    let lock = folder.join("images.sock.lock");
    let is_removed = |path: &Path| fs::remove_file(path).unwrap();
    type Spoil<'a> = (&'a str, bool, &'a dyn Fn());
    let ways: [Spoil; 6] = [
        ("the socket", true, &|| is_removed(&path)),
        ("the lock file", false, &|| is_removed(&lock)),
        ("both", true, &|| {
            is_removed(&path);
            is_removed(&lock);
        }),
        ("the folder", true, &|| fs::remove_dir_all(folder).unwrap()),
        ("the folder, renamed", true, &|| {
            fs::rename(folder, dir.path().join("elsewhere")).unwrap();
        }),
        ("the socket, replaced by a stale one", true, &|| {
            is_removed(&path);
            drop(UnixListener::bind(&path).unwrap());
        }),
    ];
    let mut taken = take(&path).unwrap();
    let mut listener = taken.listen(SockType::Stream, 8).unwrap();
    for (what, is_anew, spoil) in ways {
        assert!(taken.is_whole(), "{what}");
        spoil();
        assert!(!taken.is_whole(), "{what}");
        let anew = taken.retake(|place| place.listen(SockType::Stream, 8)).unwrap();
        assert_eq!(anew.is_some(), is_anew, "{what}");
        listener = anew.unwrap_or(listener);
        UnixStream::connect(&path).unwrap();
        assert_eq!((mode(&path), mode(&lock)), (0o660, 0o600), "{what}");
        assert!(
            matches!(take(&path), Err(SocketPathError::InUse { .. })),
            "{what}"
        );
    }
    drop((taken, listener));
    assert!(!folder.exists());
}

#[test]
fn a_path_that_somebody_else_has_taken_is_left_to_him_and_taken_again_when_he_is_gone() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("taxeld/images.sock");
    let mut first = take(&path).unwrap();
    let first_listener = first.listen(SockType::Stream, 8).unwrap();
    fs::remove_dir_all(path.parent().unwrap()).unwrap();
    let mut second = take(&path).unwrap();
    let second_listener = second.listen(SockType::Stream, 8).unwrap();
    let mut refused = || {
        first
            .retake(|place| place.listen(SockType::Stream, 8))
            .unwrap_err()
    };
    assert!(matches!(refused(), SocketPathError::InUse { .. }));
    drop((second, second_listener));
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(&path, "precious").unwrap();
    assert!(matches!(refused(), SocketPathError::NotASocket { .. }));
    assert_eq!(fs::read(&path).unwrap(), b"precious");
    fs::remove_file(&path).unwrap();
    assert!(
        first
            .retake(|place| place.listen(SockType::Stream, 8))
            .unwrap()
            .is_some()
            && first.is_whole()
    );
    drop(first_listener);
    assert!(first.is_whole());
}

#[test]
fn a_start_that_fails_for_its_group_names_it_and_leaves_nothing_behind() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("taxeld/images.sock");
    let error = SocketPath::take(&path, 0o660, "no-such-group").unwrap_err();
    assert!(error.to_string().contains("no-such-group"), "{error}");
    assert!(!path.parent().unwrap().exists());
}
