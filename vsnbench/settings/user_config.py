"""Content of `vsnbench.toml`: values for what a command line and the environment leave out."""

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, PrivateAttr, ValidationInfo

from vsnbench.files.home import expanded
from vsnbench.settings.number_errors import as_written
from vsnbench.settings.toml_file import parse_toml

_FILE = "file"
"""Key of the validation context: the file, which paths in it are relative to; absent without one."""


def seen_from_here(file: Path, value: str) -> str:
    """Return a path in a file as seen from the working directory."""
    if file.parent == Path.cwd() and not value.startswith("~"):
        return value
    return str(file.parent / expanded(value))


def _printable(text: str) -> str:
    if not text.strip() or not text.isprintable():
        raise ValueError(f"expected printable text, got {text[:40]!r}")
    return text


def _located(text: str, info: ValidationInfo) -> str:
    """Return a path as seen from the working directory; names of sites, protocols and programs stay as they are."""
    file = (info.context or {}).get(_FILE)
    is_name = (info.field_name in ("site", "protocol") and not text.endswith((".yaml", ".yml"))) or (
        info.field_name == "python" and "/" not in text
    )
    return text if file is None or is_name else seen_from_here(file, text)


def _as_path(value: Any, info: ValidationInfo) -> Any:
    if value is None or isinstance(value, Path):
        return value
    if not isinstance(value, str):
        raise ValueError(  # noqa: TRY004 - pydantic reports a ValueError as a field's error
            f'expected text, got {as_written(value)}: write it in quotes: "{as_written(value)}"'
        )
    return Path(_located(_printable(value), info))


_Text = Annotated[str, AfterValidator(_printable)]
_PathText = Annotated[str, AfterValidator(_printable), AfterValidator(_located)]
_Path = Annotated[Path, BeforeValidator(_as_path)]


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class ConsoleConfig(_Section):
    """Section `[console]`: the operator's page."""

    address: _Text = "127.0.0.1"
    port: int = Field(default=8710, ge=0, le=65535, description="0 for any free port")
    certificate: _Path | None = Field(default=None, description="PEM file; the page is served over TLS")
    key: _Path | None = Field(default=None, description="PEM file of the certificate's private key")


class IsolationConfig(_Section):
    """Section `[isolation]`: the process of a model with `--isolate`."""

    python: _Path | None = Field(default=None, description="interpreter; else the one that runs vsnbench")
    memory_gib: float | None = Field(default=None, ge=0.1, description="memory limit, GiB")
    hide_results: bool = Field(
        default=False,
        description="the process cannot read the results, which have the robot's true poses; needs Landlock",
    )


class ClusterConfig(_Section):
    """Section `[cluster]`: the workers of `--workers ray://HEAD:PORT`."""

    workers: int | None = Field(default=None, ge=1, le=4096, description="else as many as the cluster has room for")
    gpus_per_worker: float = Field(default=0.0, ge=0, le=64)


class ModelsConfig(_Section):
    """Section `[models]`: how models are run."""

    act_timeout_s: float | None = Field(
        default=None,
        ge=0.1,
        le=600,
        description="time limit for an action; else 10 s with a remote model and no limit otherwise",
    )
    device: _Text | None = Field(
        default=None,
        description="auto, cpu, cuda or mps, for models that have a device; not for a third-party model in its own "
        "process",
    )
    fit: Literal["full", "crop"] = Field(
        default="full", description="images for a model: the robot's, or cropped to the view that it was trained with"
    )


class StudyConfig(_Section):
    """Section `[study]`: how studies are run."""

    model_memory_gib: float | None = Field(
        default=None, ge=0.1, description="memory for loaded models; else half of the machine's"
    )


class BundleConfig(_Section):
    """Section `[bundle]`: what bundles say about their authors."""

    author: _Text | None = Field(default=None, description="names, separated by semicolons")
    licence: _Text | None = Field(default=None, description="SPDX identifier such as CC-BY-4.0, or a URL")
    citation: _Text | None = None


class UserConfig(_Section):
    """The file's content; all defaults without one."""

    site: _PathText | None = Field(default=None, description="file, or name of an embedded site")
    robot: _Text | None = None
    protocol: _PathText | None = Field(default=None, description="file, or name of a protocol")
    results: _PathText | None = Field(default=None, description="directory or database")
    operator: _Text | None = None
    weights: _PathText | None = Field(default=None, description="directory of the models' weights")
    console: ConsoleConfig = ConsoleConfig()
    isolation: IsolationConfig = IsolationConfig()
    cluster: ClusterConfig = ClusterConfig()
    models: ModelsConfig = ModelsConfig()
    study: StudyConfig = StudyConfig()
    bundle: BundleConfig = BundleConfig()

    _file: Path | None = PrivateAttr(default=None)

    def model_post_init(self, context: Any) -> None:
        """Keep the file that the content is from."""
        self._file = (context or {}).get(_FILE)

    @property
    def file(self) -> Path | None:
        """The file; None without one."""
        return self._file

    @classmethod
    def of_text(cls, text: str, file: Path) -> Self:
        """Return the content of a file with this text. Relative paths are relative to the file.

        Raises:
            InvalidSettingsError: the text is not TOML, or has an unknown key or an invalid value.
        """
        return parse_toml(text, str(file), cls, "configuration", {_FILE: file})

    @classmethod
    def sections(cls) -> dict[str, type[BaseModel]]:
        """Return the model of each section."""
        return {
            name: field.annotation
            for name, field in cls.model_fields.items()
            if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel)
        }
