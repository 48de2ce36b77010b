"""The Debian package under a real systemd: installed and upgraded."""

import grp
import os
import pwd
from pathlib import Path

from harness.service import configure, install, is_active, run, systemctl



def test_installed_it_waits_for_its_configuration_with_user_groups_and_kernel_setting_in_place(package):
    assert pwd.getpwnam("taxeld").pw_name in grp.getgrnam("tactile-control").gr_mem
    assert int(Path("/proc/sys/net/core/rmem_max").read_text()) == 4194304
    # What is started speaks to boards; the buses of this hand are not in the configuration yet.
    assert systemctl("is-enabled", "taxeld.service").stdout.strip() == "disabled" and not is_active()
    assert run("taxeld", "--config", "/etc/taxeld/taxeld.toml", "--check").returncode == 0
    assert "watch" in run("bash", "-c", ". /usr/share/bash-completion/completions/taxel; complete -p taxel; type _taxel").stdout
    for page in ("man8/taxeld.8.gz", "man1/taxel.1.gz", "man1/taxel-watch.1.gz"):
        assert Path("/usr/share/man", page).exists()
    for driver in ("display.c", "display.js", "display.py", "display.rs"):
        assert Path("/usr/share/doc/taxeld/examples", driver).exists()


def test_an_upgrade_runs_the_new_one_where_the_old_one_ran_and_keeps_the_configuration(service):
    with service.config.open("a") as config:
        config.write("# mine\n")
    service.start()
    pid = service.pid
    install(os.environ["TAXEL_PACKAGE"])
    assert is_active() and service.pid != pid
    assert service.config.read_text().endswith("# mine\n")


def test_what_another_program_has_raised_is_not_lowered_at_once_or_at_the_next_start(package):
    limit, others = Path("/proc/sys/net/core/rmem_max"), Path("/etc/sysctl.d/10-others.conf")
    before = limit.read_text()
    try:
        others.parent.mkdir(exist_ok=True)
        others.write_text("net.core.rmem_max = 8388608\n")
        limit.write_text("8388608")
        configure()
        assert limit.read_text() == "8388608\n"
        run("/usr/lib/systemd/systemd-sysctl", check=True)
        assert limit.read_text() == "8388608\n"
    finally:
        others.unlink(missing_ok=True)
        limit.write_text(before)
