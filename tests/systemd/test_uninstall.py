"""The Debian package removed and purged under a real systemd. By its name the last file: those before it need the package."""

from pathlib import Path

from harness.service import dpkg, is_active, systemctl

UNITS = ("taxeld.service", "taxel-record.service", "taxel-metrics@left.service")
ENABLED = [Path("/etc/systemd/system/multi-user.target.wants", unit) for unit in UNITS]


def test_removed_it_is_stopped_and_purged_it_is_gone(service):
    systemctl("enable", "--now", *UNITS, check=True)
    assert all(link.is_symlink() for link in ENABLED) and is_active()
    dpkg("--remove", "taxeld")
    assert systemctl("is-active", *UNITS).stdout.split() == ["inactive"] * 3 and service.config.exists()
    dpkg("--purge", "taxeld")
    assert not service.config.exists() and not any(link.is_symlink() for link in ENABLED)
    for left in ("/usr/bin/taxel", "/usr/share/doc/taxeld", "/usr/lib/systemd/system/taxeld.service"):
        assert not Path(left).exists(), left
