"""What packages and archives hold: packaging/stage, without a package made of it."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from harness.daemon import binary
from harness.pages import DOCS, commands

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def packaged(tmp_path_factory):
    root = tmp_path_factory.mktemp("package")
    # Stripping programs with debug information takes long, and nothing here runs them.
    environment = {**os.environ, "STRIP": "true"}
    subprocess.run([ROOT / "packaging/stage", binary("taxel").parent, root], check=True, env=environment)
    return root


def test_links_of_packaged_pages_lead_to_what_is_packaged(packaged):
    pages = packaged / "usr/share/doc/taxeld"
    links = []
    for page in pages.glob("*.md"):
        for link in re.findall(r"\]\(([^)#\s]+)", page.read_text()):
            if not re.match(r"[a-z]+:", link):
                links.append(link)
                assert (pages / link).exists(), f"{page.name}: {link}"
    assert any(link.endswith(".svg") for link in links)


def test_pages_of_man_refer_to_pages_and_files_that_are_packaged(packaged):
    man = packaged / "usr/share/man"
    pages = {page.name.removesuffix(".gz") for page in man.glob("*/*.gz")}
    assert {"taxel.1", "taxel-config-init.1", "taxel-forearm-record.1", "taxeld.8"} <= pages
    for page in man.glob("*/*.gz"):
        text = subprocess.run(["zcat", page], capture_output=True, text=True, check=True).stdout
        text = text.replace("\\-", "-")
        for name, section in re.findall(r"([a-z-]+)\(([18])\)", text):
            assert f"{name}.{section}" in pages, f"{page.name}: {name}({section})"
        for path in re.findall(r"/usr/share/doc/taxeld/[\w./-]+\w", text):
            assert (packaged / path.lstrip("/")).exists(), f"{page.name}: {path}"


def test_what_the_guide_installs_by_hand_is_what_is_packaged(packaged, tmp_path):
    by_hand = [line for line in commands(DOCS / "guide.md") if re.match(r"install .*\bsystemd/", line)]
    # Where a machine has them.
    for folder in ("etc/systemd/system", "etc/udev/rules.d", "usr/lib/sysusers.d", "usr/lib/sysctl.d"):
        (tmp_path / folder).mkdir(parents=True)
    for line in by_hand:
        there = re.sub(r" /(?=etc/|usr/)", f" {tmp_path}/", line)
        subprocess.run(["bash", "-euc", there], cwd=ROOT, check=True)
    found = {str(path.relative_to(tmp_path)): path.read_text() for path in tmp_path.rglob("*") if path.is_file()}
    examples = "usr/share/doc/taxeld/examples"
    wanted = {
        **{f"etc/systemd/system/{unit.name}": unit for unit in (packaged / "usr/lib/systemd/system").iterdir()},
        "usr/lib/sysusers.d/taxeld.conf": packaged / "usr/lib/sysusers.d/taxeld.conf",
        "usr/lib/sysctl.d/05-taxeld.sysctl.conf": packaged / "usr/lib/sysctl.d/05-taxeld.conf",
        "etc/udev/rules.d/60-taxeld-serial.rules": packaged / "usr/lib/udev/rules.d/60-taxeld-serial.rules",
        "etc/taxeld/taxeld.toml": packaged / "etc/taxeld/taxeld.toml",
        "etc/systemd/system/taxeld.service.d/serial.conf": packaged / examples / "taxeld-serial.conf",
        "etc/systemd/system/taxeld.service.d/network.conf": packaged / examples / "taxeld-network.conf",
    }
    assert found == {place: path.read_text() for place, path in wanted.items()}


@pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="no systemd-analyze: apt-get install systemd")
def test_units_are_understood_and_have_few_rights(packaged, tmp_path):
    units = sorted((packaged / "usr/lib/systemd/system").iterdir())
    programs = ("taxel-metrics", "taxel-record", "taxeld")
    assert [unit.name for unit in units] == [f"{name}{kind}.service" for name in programs for kind in ("", "@")]
    for unit in units:
        # Where the programs are here.
        copy = tmp_path / unit.name.replace("@", "@left")
        copy.write_text(re.sub("^(Exec[A-Z][a-z]+=)taxel", rf"\1{packaged}/usr/bin/taxel", unit.read_text(), flags=re.M))
        for command in (["verify", "--man=no"], ["security", "--offline=true", "--no-pager", "--threshold=14"]):
            judged = subprocess.run(["systemd-analyze", *command, copy], capture_output=True, text=True)
            assert judged.returncode == 0 and copy.name not in judged.stderr, judged.stdout + judged.stderr


def test_the_kernel_setting_is_read_before_those_of_others_so_that_a_larger_one_is_not_lowered(packaged):
    others = ("10-cyclone-max.conf", "10-network-security.conf", "50-default.conf", "60-cyclonedds.conf")
    ours = list((packaged / "usr/lib/sysctl.d").iterdir())
    assert [name.name for name in ours if name.name < min(others)] == ["05-taxeld.conf"] and len(ours) == 1
