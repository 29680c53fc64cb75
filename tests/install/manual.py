# SPDX-License-Identifier: Apache-2.0
"""manual.py PREFIX GENERATOR: the installed manual and completion say what --help says, and are well formed."""
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

prefix, generator = map(Path, sys.argv[1:])
share = prefix / "share"
pages = share / "man/man1"
bash_script = share / "bash-completion/completions/kinescope"
zsh_script = share / "zsh/site-functions/_kinescope"


def output(*command):
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0 and not done.stderr, f"{command}: {done.returncode} {done.stderr}"
    return done.stdout


def help_of(*command):
    return output(prefix / "bin/kinescope", *command, "--help")


def options_of(help_text):
    """Every short and long option that a help text lists."""
    return {option for names in re.findall(r"^  (-\S+)", help_text, re.M)
            for option in re.findall(r"--?[a-z][a-z-]*", names)}


def completed_by_bash(*words):
    """What the script offers for the last of the words."""
    script = (f'source "{bash_script}"; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _kinescope; '
              'printf "%s\\n" "${COMPREPLY[@]}"')
    return set(output("bash", "-c", script, "bash", "kinescope", *words).split())


def check_command(name):
    options = options_of(help_of(*([name] if name else [])))
    assert "--help" in options, f"{name}: {options}"
    page = (pages / (f"kinescope-{name}.1" if name else "kinescope.1")).read_text()
    for option in options:
        assert f"\\fB{option}\\fR".replace("-", "\\-") in page, f"{option} of '{name}' is in no manual page"
    words = [name, "-"] if name else ["-"]
    assert completed_by_bash(*words) == options, f"bash on '{name}': {completed_by_bash(*words)}, not {options}"
    section = re.search(rf"^    {name}\)\n(.*?)^      ;;" if name else r"_arguments -C(.*?)&& return",
                        zsh_script.read_text(), re.M | re.S)
    assert section, f"zsh does not know '{name}'"
    offered = set(re.findall(r"^ +'(?:\*|\([^)]*\))(--?[a-z-]+?)[=+]?\[", section[1], re.M))
    assert offered == options, f"zsh on '{name}': {offered}, not {options}"


def check_words():
    assert completed_by_bash("run", "--free", "") == {"placement", "offsets", "geometry"}
    assert completed_by_bash("camera", "--board", "=", "ch") == {"chessboard", "charuco"}
    assert completed_by_bash("run", "--folds", "") == set()
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "recording").mkdir()
        (Path(folder) / "robot.urdf").touch()
        # A recording is a folder, or a bag.
        assert completed_by_bash("run", folder + "/") == {folder + "/recording", folder + "/robot.urdf"}
        assert completed_by_bash("run", "--nominal", folder + "/rob") == {folder + "/robot.urdf"}


def check_same_again():
    with tempfile.TemporaryDirectory() as folder:
        output(generator, folder)
        for page in Path(folder).glob("man1/*"):
            assert page.read_text() == (pages / page.name).read_text(), f"{page.name} differs on a second run"
        assert (Path(folder) / "kinescope.bash").read_text() == bash_script.read_text()
        assert (Path(folder) / "_kinescope").read_text() == zsh_script.read_text()


commands = re.findall(r"^  ([a-z]+) ", help_of().split("Subcommands:")[1].split("\n\n")[0], re.M)
assert "run" in commands, commands
assert {page.name for page in pages.iterdir()} == {"kinescope.1"} | {f"kinescope-{c}.1" for c in commands}
assert completed_by_bash("") == set(commands)
for command in ["", *commands]:
    check_command(command)
check_words()
check_same_again()
if shutil.which("groff"):
    for page in pages.iterdir():
        output("groff", "-man", "-ww", "-z", "-Tutf8", page)  # a warning is no empty standard error
else:
    print("groff is not installed: the pages are not formatted")
if shutil.which("zsh"):
    output("zsh", "-n", zsh_script)
else:
    print("zsh is not installed: its script is not parsed")
