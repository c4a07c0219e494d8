"""Options that several commands share."""

from pathlib import Path

import pytest

from vsnbench.cli.support.options import operator_page, requested_workers, sites_of
from vsnbench.errors import UsageError


@pytest.mark.parametrize(
    ("console", "address", "port"),
    [
        ("", "127.0.0.2", 9000),
        ("0.0.0.0:8710", "0.0.0.0", 8710),
        (":0", "127.0.0.2", 0),
        ("192.168.1.5", "192.168.1.5", 9000),
    ],
)
def test_the_page_is_where_the_option_or_the_configuration_puts_it(
    console: str, address: str, port: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "vsnbench.toml").write_text('[console]\naddress = "127.0.0.2"\nport = 9000\nkey = "key.pem"\n')
    monkeypatch.chdir(tmp_path)
    page = operator_page(console)
    assert page is not None
    assert (page.address, page.port, page.private_key) == (address, port, Path("key.pem"))


def test_workers_are_a_number_or_auto_or_a_cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "vsnbench.toml").write_text("[cluster]\nworkers = 16\ngpus_per_worker = 0.25\n")
    monkeypatch.chdir(tmp_path)
    assert requested_workers("3").count == 3
    assert requested_workers("auto").count is None
    cluster = requested_workers("ray://head:10001")
    assert (cluster.count, str(cluster.cluster), cluster.gpus_each) == (16, "ray://head:10001", 0.25)
    for text in ("0", "-1", "many", "99999"):
        with pytest.raises(UsageError) as refused:
            requested_workers(text)
        assert refused.value.code == "invalid-workers"


def test_a_site_in_the_environment_may_have_blanks_and_commas(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VSNBENCH_SITE", "our lab, 2nd floor.yaml")
    assert sites_of(None) == ("our lab, 2nd floor.yaml",)
    assert sites_of(["apartment,flat:1"]) == ("apartment", "flat:1")
    monkeypatch.delenv("VSNBENCH_SITE")
    assert sites_of(None) == ("apartment",)
