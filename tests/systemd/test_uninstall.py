"""The Debian package removed and purged under a real systemd. By its name the last file: those before it need the package."""

from pathlib import Path

from harness.service import dpkg, is_active, systemctl

LONGEST_TEST_S = 600  # in an emulated machine
ENABLED = Path("/etc/systemd/system/multi-user.target.wants/taxeld.service")


def test_removed_it_is_stopped_and_purged_it_is_gone(service):
    systemctl("enable", "--now", "taxeld.service", check=True)
    assert ENABLED.is_symlink() and is_active()
    dpkg("--remove", "taxeld")
    assert not is_active() and service.config.exists()
    dpkg("--purge", "taxeld")
    assert not service.config.exists() and not ENABLED.is_symlink()
    for left in ("/usr/bin/taxel", "/usr/share/doc/taxeld", "/usr/lib/systemd/system/taxeld.service"):
        assert not Path(left).exists(), left
