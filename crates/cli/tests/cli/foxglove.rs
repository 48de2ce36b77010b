//! `taxel foxglove`, as far as it needs no daemon.

use crate::fails;
use tempfile::TempDir;

#[cfg(not(feature = "foxglove"))]
#[test]
fn a_build_without_it_says_how_one_with_it_is_made() {
    let dir = TempDir::new().unwrap();
    let err = fails(&dir, &["foxglove"], 1);
    assert!(err.contains("--features foxglove"), "{err}");
}

#[cfg(feature = "foxglove")]
#[test]
fn an_address_that_is_taken_is_named() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let dir = TempDir::new().unwrap();
    let err = fails(&dir, &["foxglove", "--listen", &address], 1);
    assert!(err.contains(&format!("cannot listen at {address}")), "{err}");
}

#[test]
fn an_address_that_is_none_is_wrong_use() {
    let dir = TempDir::new().unwrap();
    for address in ["8765", "localhost", "127.0.0.1:99999"] {
        let err = fails(&dir, &["foxglove", "--listen", address], 2);
        assert!(err.contains("127.0.0.1:8765"), "{err}");
    }
}
