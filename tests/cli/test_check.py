"""`drpt check`: bad input, the reports and the maps."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import drpt
from drpt import cli, output
from tests.cli.running import files, status_of

CHECK_FLAGS = ["--spp", "64", "--bounces", "1", "--width", "16", "--height", "12"]


class TestCheck:
    @pytest.mark.parametrize(
        ("flags", "says"),
        [
            (["--mode", "fast"], "mode: 'fast'"),
            (["--spp", "100"], "spp: 100 is not allowed; it must be a multiple of 64"),
            (["--bounces", "-1"], "bounces: -1"),
            (["--sampler", "halton"], "sampler: 'halton'"),
            (["--width", "0"], "width: 0"),
            (["--against", "no.exr"], "no.exr"),
            (["--against", "good.toml"], "good.toml: this is not a readable EXR file"),
            (["-o", "good.toml"], "good.toml: this is a file, and maps need a folder"),
            (["--against", "a.npy"], "a.npy: No such file or directory"),
        ],
    )
    def test_bad_input_is_refused(
        self, flags: list[str], says: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        before = files()
        assert status_of(cli.main, ["check", "good.toml", *flags]) == 2
        printed, complaint = capsys.readouterr()
        assert printed == ""
        assert complaint.startswith("drpt check: error: ")
        assert says in complaint
        assert complaint.count("\n") == 1
        assert files() == before

    def test_all_modes_are_held_against_mitsuba(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert cli.main(["check", "good.toml", "--mode", "all", *CHECK_FLAGS]) == 0
        printed, complaint = capsys.readouterr()
        assert printed.startswith("reference: Mitsuba 3.9.1 (llvm_ad_rgb), 64 spp, 16x12, 1 bounce")
        assert [mode for mode in drpt.Mode if f"\n{mode}, sobol, 64 spp: " in printed] == [
            *drpt.Mode
        ]
        assert complaint == ""
        assert files() == ["good.toml"]

    def test_maps_are_written_where_they_are_asked_for(self) -> None:
        assert cli.main(["check", "good.toml", "-o", "maps", *CHECK_FLAGS]) == 0
        assert sorted(path.name for path in Path("maps").glob("*.exr")) == [
            f"mis-1-{name}.exr" for name in ("difference", "image", "p-value", "reference")
        ]

    @pytest.mark.parametrize(
        ("flags", "says"),
        [
            (["--width", "16", "--height", "12"], "width: 16 is not allowed; it must be 8, as in"),
            (["--bounces", "2"], "bounces: 2 is not allowed; it must be 1, as in a.exr"),
        ],
    )
    def test_settings_must_be_those_of_the_reference(
        self, flags: list[str], says: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        drpt.render(drpt.load_scene("good.toml"), 4, 1).save("a.exr")
        command = ["check", "good.toml", "--against", "a.exr", "--spp", "64", "-o", "maps"]
        assert status_of(cli.main, [*command, *flags]) == 2
        assert says in capsys.readouterr().err
        assert files() == ["a.exr", "good.toml"]

    def test_nobody_who_reads_it_is_no_pass(self) -> None:
        script = "from drpt.cli import main; import sys; sys.exit(main())"
        command = [sys.executable, "-c", script, "check", "good.toml", *CHECK_FLAGS]
        reader, writer = os.pipe()
        os.close(reader)
        assert subprocess.run(command, stdout=writer, check=False).returncode == 1
        os.close(writer)

    def test_a_picture_that_differs_fails(self, capsys: pytest.CaptureFixture[str]) -> None:
        """The reference is brighter by a tenth; it tells its own bounces and size."""
        scene = drpt.load_scene("good.toml")
        picture = drpt.render(scene, 4096, 1)
        layers = {"standard_error": 1.1 * picture.standard_error}
        output.write("a.exr", 1.1 * picture.image, picture.metadata, layers=layers)
        assert cli.main(["check", "good.toml", "--against", "a.exr", "--spp", "65536"]) == 1
        printed, _ = capsys.readouterr()
        assert "reference: a.exr, 8x6, 1 bounce" in printed
        assert "mis, sobol, 65536 spp: differs" in printed
        assert "good-check/mis-1-p-value.png" in printed
        assert Path("good-check/mis-1-difference.png").is_file()

    @pytest.mark.parametrize(("flags", "status"), [([], 0), (["--strict"], 1)])
    def test_what_cannot_be_told_fails_if_it_must_be(
        self, flags: list[str], status: int, capsys: pytest.CaptureFixture[str]
    ) -> None:
        drpt.render(drpt.load_scene("good.toml"), 64, 1, error=False).save("a.exr")
        command = ["check", "good.toml", "--against", "a.exr", "--spp", "64"]
        assert cli.main([*command, *flags]) == status
        assert "mis, sobol, 64 spp: cannot tell" in capsys.readouterr()[0]
        assert files() == ["a.exr", "good.toml"]

    def test_a_written_reference_is_good_for_the_next_check(
        self, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert cli.main(["check", "good.toml", "-o", "maps", *CHECK_FLAGS]) == 0
        reference = "maps/mis-1-reference.exr"
        assert cli.main(["check", "good.toml", "--against", reference, "--spp", "64"]) == 0
        printed, complaint = capsys.readouterr()
        assert f"reference: {reference}, 16x12, 1 bounce\n\n" in printed
        assert complaint == ""
