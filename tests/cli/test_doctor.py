"""`drpt doctor`."""

import pytest

from drpt import cli, doctor


@pytest.mark.parametrize("status", [0, 1])
def test_doctor_decides_on_the_status(status: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "main", lambda: status)
    assert cli.main(["doctor"]) == status
