"""A file from a hostile hand, or a broken one, is refused in one line; nothing in it runs and memory stays bounded."""

import contextlib
import gzip
import io
import os
import pickle
import resource
import subprocess
import tarfile
import zipfile
import zlib
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.models.pirlnav.checkpoints import (
    SMALL,
    configuration,
    weights,
    write_archive,
    write_checkpoint,
    write_forged,
)
from vsnbench.errors import ModelError
from vsnbench.models.checkpoints.pickle_reader import read_pickle
from vsnbench.models.checkpoints.safe_checkpoint import load_checkpoint
from vsnbench.models.pirlnav.checkpoint import CONFIG_CLASSES, read_checkpoint
from vsnbench.models.pirlnav.policy import describe_weights

MARKER = "was-run"


class Calls:
    """Pickles as a call of any function."""

    def __init__(self, function: Callable[..., Any], *arguments: Any) -> None:
        self.call = function, arguments

    def __reduce__(self) -> Any:
        return self.call


def refusal(path: Path) -> str:
    """Return the one line with which a file is refused; fail if anything in it ran or much memory was taken."""
    before_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(ModelError) as raised:
        read_checkpoint(path)
    grown_mib = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kib) / 1024
    assert not (path.parent / MARKER).exists()
    assert grown_mib < 100
    line = str(raised.value)
    assert "\n" not in line
    assert path.name in line
    return line


@pytest.mark.parametrize("outer", [True, False], ids=["as the whole file", "inside the state dict"])
@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda marker: Calls(os.system, f"touch {marker}"), "posix.system"),
        (lambda marker: Calls(eval, f"open({marker!r}, 'w').close()"), "eval"),
        (lambda marker: Calls(subprocess.Popen, ["touch", marker]), "Popen"),
    ],
    ids=["os.system", "eval", "Popen"],
)
def test_a_checkpoint_that_would_run_something_is_refused_by_name(
    tmp_path: Path, call: Callable[[str], Calls], name: str, outer: bool
) -> None:
    evil = call(str(tmp_path / MARKER))
    path = tmp_path / "evil.ckpt"
    torch.save(evil if outer else {"state_dict": {"w": torch.zeros(2), "x": evil}, "config": {}}, path)
    line = refusal(path)
    assert name in line
    assert "nothing was run" in line


def test_the_call_in_those_files_is_real(tmp_path: Path) -> None:
    path = tmp_path / "evil.ckpt"
    torch.save(Calls(os.system, f"touch {tmp_path / MARKER}"), path)
    torch.load(path, weights_only=False)
    assert (tmp_path / MARKER).exists()


def test_a_bare_pickle_is_refused(tmp_path: Path) -> None:
    for protocol in range(5):
        path = tmp_path / f"bare{protocol}.ckpt"
        path.write_bytes(pickle.dumps(Calls(os.system, f"touch {tmp_path / MARKER}"), protocol))
        assert "bare pickle" in refusal(path)


def test_the_legacy_format_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "legacy.ckpt"
    torch.save({"state_dict": weights(SMALL)}, path, _use_new_zipfile_serialization=False)
    assert "legacy format" in refusal(path)


def test_the_oldest_format_a_tar_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "oldest.ckpt"
    with tarfile.open(path, "w") as archive:
        for name in ("storages", "tensors", "pickle"):
            content = pickle.dumps(Calls(os.system, f"touch {tmp_path / MARKER}"))
            entry = tarfile.TarInfo(name)
            entry.size = len(content)
            archive.addfile(entry, io.BytesIO(content))
    assert "tar archive" in refusal(path)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_torchscript_program_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "script.ckpt"
    torch.jit.save(torch.jit.script(torch.nn.Linear(2, 2)), str(path))
    assert "TorchScript" in refusal(path)


@pytest.mark.parametrize("kept", [0.0, 0.3, 0.9, 0.9999])
def test_a_truncated_file_is_refused(tmp_path: Path, small_checkpoint: Path, kept: float) -> None:
    whole = small_checkpoint.read_bytes()
    path = tmp_path / "short.ckpt"
    path.write_bytes(whole[: int(len(whole) * kept)])
    assert "download it again" in refusal(path)


def test_an_archive_on_two_disks_is_refused(tmp_path: Path, small_checkpoint: Path) -> None:
    whole = bytearray(small_checkpoint.read_bytes())
    disks = whole.rindex(b"PK\x06\x07") + 16  # in the locator of the zip64 directory
    whole[disks : disks + 4] = (2).to_bytes(4, "little")
    path = tmp_path / "two-disks.ckpt"
    path.write_bytes(whole)
    assert "download it again" in refusal(path)


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"<!DOCTYPE html><title>Sign in</title>", "web page"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:00", "Git LFS"),
        (b"PIRL" * 100, "not a PyTorch checkpoint"),
    ],
)
def test_what_came_in_place_of_weights_is_named(tmp_path: Path, content: bytes, what: str) -> None:
    path = tmp_path / "other.ckpt"
    path.write_bytes(content)
    assert what in refusal(path)


@pytest.mark.parametrize(
    ("elements", "shape", "stride", "says"),
    [
        (10**13, (10**13,), (1,), "should have 40000000000000 bytes, the file has 4"),
        (1, (10**13,), (1,), "declared over 1 stored numbers"),
        (1, (10**6, 10**6), (0, 0), "declared over 1 stored numbers"),
        (1, (2**62, 4), (1, 2**62), "declared over 1 stored numbers"),
        (1, (1,), (-1,), "impossible shape"),
        (-1, (1,), (1,), "without a size"),
    ],
    ids=["storage", "shape", "expanded", "overflowing", "negative stride", "negative storage"],
)
def test_a_tensor_bomb_is_refused_before_memory_is_taken(
    tmp_path: Path, elements: int, shape: tuple[int, ...], stride: tuple[int, ...], says: str
) -> None:
    assert says in refusal(write_forged(tmp_path / "bomb.ckpt", elements, shape, stride))


def test_a_compression_bomb_is_refused(tmp_path: Path) -> None:
    path = write_archive(tmp_path / "zip.ckpt", bytes(300 * 2**20), zipfile.ZIP_DEFLATED)
    assert path.stat().st_size < 2**20
    assert "compressed" in refusal(path)


def test_a_forged_compressed_size_is_refused_before_memory_is_taken(tmp_path: Path, small_checkpoint: Path) -> None:
    content = bytearray(small_checkpoint.read_bytes())
    place = content.index(b"PK\x01\x02") + 20  # compressed size in the directory's first entry
    content[place : place + 4] = (2**31).to_bytes(4, "little")
    path = tmp_path / "forged.ckpt"
    path.write_bytes(content)
    assert "claim more bytes than the file has" in refusal(path)


def test_nested_tuples_that_would_be_hashed_for_ever_are_refused(tmp_path: Path) -> None:
    nest = b"\x80\x02)" + b"".join(b"q\x00h\x00\x86" for _ in range(80)) + b"."
    assert "nested too deeply" in refusal(write_archive(tmp_path / "nest.ckpt", nest))


def test_a_pickle_that_does_what_no_checkpoint_does_is_refused(tmp_path: Path) -> None:
    path = write_archive(tmp_path / "instance.ckpt", b"(cbuiltins\ndict\n(ios\nsystem\n.")
    assert "nothing was run" in refusal(path)


def test_a_vlv_file_is_named_as_such(tmp_path: Path) -> None:
    path = tmp_path / "vlv_model.torch"
    torch.save({"model_state_dict": OrderedDict({"resnet.conv1.weight": torch.zeros(64, 3, 7, 7)})}, path)
    assert "VLV weights" in refusal(path)


def test_missing_weights_are_counted_and_one_is_named(tmp_path: Path) -> None:
    state = weights(SMALL)
    del state["net.visual_fc.1.bias"], state["net.gps_embedding.weight"]
    line = refusal(write_checkpoint(tmp_path / "missing.ckpt", state=state))
    assert "2 of 185 weights are missing" in line
    assert "net.gps_embedding.weight" in line


def test_surplus_weights_are_refused(tmp_path: Path) -> None:
    state = weights(SMALL) | {"net.depth_encoder.weight": torch.zeros(2)}
    assert "net.depth_encoder.weight" in refusal(write_checkpoint(tmp_path / "surplus.ckpt", state=state))


def test_a_wrong_shape_is_named_with_both_shapes(tmp_path: Path) -> None:
    state = weights(SMALL) | {"net.visual_fc.1.bias": torch.zeros(9)}
    line = refusal(write_checkpoint(tmp_path / "shape.ckpt", state=state))
    assert "net.visual_fc.1.bias has shape (9,)" in line
    assert "(8,)" in line


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
def test_weights_that_are_not_finite_are_refused(tmp_path: Path, number: float) -> None:
    state = weights(SMALL)
    state["net.visual_encoder.compression.0.weight"][0, 0, 0, 0] = number
    line = refusal(write_checkpoint(tmp_path / "nan.ckpt", state=state))
    assert "net.visual_encoder.compression.0.weight contains NaN or infinite" in line


def test_a_configuration_of_absurd_size_is_refused(tmp_path: Path) -> None:
    huge = SMALL.model_copy(update={"hidden_size": 10**9})
    line = refusal(write_checkpoint(tmp_path / "huge.ckpt", huge, state=weights(SMALL)))
    assert "POLICY.STATE_ENCODER.hidden_size is 1000000000" in line


def test_another_backbone_is_refused(tmp_path: Path) -> None:
    other = SMALL.model_copy(update={"backbone": "vit_small_patch16"})
    line = refusal(write_checkpoint(tmp_path / "vit.ckpt", other, state=weights(SMALL)))
    assert "vit_small_patch16" in line


def test_a_checkpoint_without_its_configuration_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bare-weights.ckpt"
    torch.save({"state_dict": weights(SMALL)}, path)
    assert "no configuration" in refusal(path)


@pytest.mark.parametrize("bit", [0, 5, 7])
def test_one_flipped_bit_in_the_weights_is_noticed(small_checkpoint: Path, tmp_path: Path, bit: int) -> None:
    with zipfile.ZipFile(small_checkpoint) as archive:
        record = max(archive.infolist(), key=lambda entry: entry.file_size)
        content = archive.read(record)
    whole = bytearray(small_checkpoint.read_bytes())
    whole[whole.index(content) + len(content) // 2] ^= 1 << bit
    (tmp_path / "flipped.ckpt").write_bytes(whole)
    assert "differs from its checksum" in refusal(tmp_path / "flipped.ckpt")


def forged_tensor(storage: bytes, elements: int) -> bytes:
    """Return the instructions that make a tensor of a storage."""
    size = b"J" + elements.to_bytes(4, "little") + b"\x85"
    return b"ctorch._utils\n_rebuild_tensor_v2\n(" + storage + b"K\x00" + size + b"K\x01\x85\x89}tR"


def forged_storage(kind: bytes, key: bytes, elements: int) -> bytes:
    """Return the instructions that declare a storage."""
    size = b"J" + elements.to_bytes(4, "little")
    return b"(U\x07storagectorch\n" + kind + b"\nU\x01" + key + b"U\x03cpu" + size + b"tQ"


def test_a_large_storage_cannot_be_combined_with_the_numbers_of_a_small_one(tmp_path: Path) -> None:
    large, small = forged_storage(b"ByteStorage", b"0", 1000), forged_storage(b"DoubleStorage", b"1", 1)
    declared = b"ctorch._utils\n_rebuild_parameter\n" + large + b"R"
    pickled = b"\x80\x02" + forged_tensor(declared + forged_tensor(small, 1) + b"\x86", 1000) + b"."
    path = write_archive(tmp_path / "combined.ckpt", pickled)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("ckpt/data/0", bytes(1000))
        archive.writestr("ckpt/data/1", bytes(8))
    assert "damaged or forged" in refusal(path)


def test_a_record_that_ends_before_its_declared_size_is_not_read_beyond(tmp_path: Path) -> None:
    pickled = b"\x80\x02" + forged_tensor(forged_storage(b"FloatStorage", b"0", 250), 250) + b"."
    path = write_archive(tmp_path / "short.ckpt", pickled)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("ckpt/data/0", bytes(1000))
    whole = bytearray(path.read_bytes())
    entry = whole.rindex(b"ckpt/data/0") - 46
    whole[entry + 16 : entry + 24] = zlib.crc32(bytes(8)).to_bytes(4, "little") + (8).to_bytes(4, "little")
    path.write_bytes(whole)
    assert "declared over 2 stored numbers" in refusal(path)


def test_a_list_that_is_copied_many_times_is_refused(tmp_path: Path) -> None:
    pickled = b"\x80\x02(]q\x00(" + b"N" * 60_000 + b"ectorch\nSize\nq\x01" + b"h\x01h\x00\x85R" * 300 + b"t."
    assert "items in calls" in refusal(write_archive(tmp_path / "copies.ckpt", pickled))


def test_a_shape_of_many_large_dimensions_is_refused_before_it_is_multiplied(tmp_path: Path) -> None:
    shape = b"(" + b"h\x05" * 100 + b"tq\x06h\x06"
    huge = b"\x8a\xff" + b"\xff" * 254 + b"\x7fq\x05"
    tensor = b"ctorch._utils\n_rebuild_tensor_v2\n(" + forged_storage(b"FloatStorage", b"0", 1) + b"K\x00" + shape
    path = write_archive(tmp_path / "shape.ckpt", b"\x80\x02(" + huge + tensor + b"\x89}tRt.")
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("ckpt/data/0", bytes(4))
    assert "impossible shape" in refusal(path)


def test_integers_of_equal_hash_are_refused_as_keys(tmp_path: Path) -> None:
    same = (2**61 - 1) * 5
    pickled = b"\x80\x02}\x8a\x0a" + same.to_bytes(10, "little") + b"Ns."
    assert "more than 64 bits" in refusal(write_archive(tmp_path / "hashes.ckpt", pickled))


@pytest.mark.parametrize("step", [float("nan"), float("inf"), 10**400, -5], ids=["nan", "inf", "huge", "negative"])
def test_an_impossible_training_step_is_left_out(tmp_path: Path, step: Any) -> None:
    checkpoint = read_checkpoint(write_checkpoint(tmp_path / "step.ckpt", step=step))
    assert describe_weights(checkpoint) == "step.ckpt, RL fine-tuned"


def test_a_trainer_that_is_not_a_name_is_left_out_without_printing_it(tmp_path: Path) -> None:
    nest: list[Any] = []
    for _ in range(60):
        nest = [nest, nest]
    config = configuration(SMALL) | {"TRAINER_NAME": nest}
    assert read_checkpoint(write_checkpoint(tmp_path / "trainer.ckpt", config=config)).trainer == ""


def test_a_long_name_is_shortened(tmp_path: Path) -> None:
    state = weights(SMALL) | {"B" * 10_000: torch.zeros(1)}
    assert len(refusal(write_checkpoint(tmp_path / "name.ckpt", state=state))) < 500
    long = SMALL.model_copy(update={"backbone": "B" * 10_000})
    assert len(refusal(write_checkpoint(tmp_path / "backbone.ckpt", long, state=weights(SMALL)))) < 500


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_flipped_byte_never_does_more_than_refuse(small_checkpoint: Path, data: st.DataObject) -> None:
    with zipfile.ZipFile(small_checkpoint) as archive:
        pickled = bytearray(archive.read("ckpt/data.pkl")[:6000])
    for _ in range(data.draw(st.integers(1, 4))):
        pickled[data.draw(st.integers(0, len(pickled) - 1))] = data.draw(st.integers(0, 255))
    with contextlib.suppress(ModelError):
        read_pickle(bytes(pickled), CONFIG_CLASSES, "fuzzed", lambda storage: np.zeros(4, storage.dtype))


def test_what_pytorch_wrote_is_read_as_pytorch_reads_it(tmp_path: Path) -> None:
    random = torch.Generator().manual_seed(1)
    shared = torch.randn(6, 4, generator=random)
    kinds = (torch.float64, torch.float16, torch.bfloat16, torch.int64, torch.int32, torch.int16, torch.int8)
    content = {
        "tensors": {str(kind): (10 * shared).to(kind) for kind in (*kinds, torch.uint8, torch.bool)},
        "views": [shared.T, shared[2:, 1:3], shared[:, 0], shared.expand(1, 6, 4), torch.zeros(()), torch.zeros(0, 3)],
        "parameter": torch.nn.Parameter(shared),
        "plain": OrderedDict(a=(1, -2, 2**40), b=[None, True, 1.5, "x"], c={"nested": {3: {1, 2}}}, d=shared.shape),
    }
    path = tmp_path / "kinds.ckpt"
    torch.save(content, path)
    read = load_checkpoint(path)
    for name, tensor in content["tensors"].items():
        expected = tensor.float() if tensor.dtype is torch.bfloat16 else tensor
        np.testing.assert_array_equal(read["tensors"][name], expected.numpy(), strict=True)
    for array, view in zip(read["views"], content["views"], strict=True):
        np.testing.assert_array_equal(array, view.numpy(), strict=True)
    np.testing.assert_array_equal(read["parameter"], shared.numpy())
    assert read["plain"] == content["plain"]
    assert not read["views"][0].flags.writeable


def test_a_nested_tuple_as_a_key_is_refused_without_hashing_it(tmp_path: Path) -> None:
    wide = b"".join(b"q\x00(" + b"h\x00" * 40 + b"t" for _ in range(10))
    assert "a _Tuple as a key" in refusal(write_archive(tmp_path / "key.ckpt", b"\x80\x02)" + wide + b"q\x00}h\x00Ns."))


def test_a_nested_value_in_the_configuration_is_refused_without_printing_it(tmp_path: Path) -> None:
    nest: list[Any] = []
    for _ in range(60):
        nest = [nest, nest]
    config = OrderedDict(POLICY=OrderedDict(RGB_ENCODER=OrderedDict(backbone=nest)))
    assert "POLICY.RGB_ENCODER.backbone is a list" in refusal(write_checkpoint(tmp_path / "nest.ckpt", config=config))


def test_a_compressed_tar_is_not_unpacked_to_name_it(tmp_path: Path) -> None:
    path = tmp_path / "bomb.ckpt"
    header = tarfile.TarInfo("x")
    header.type, header.size = tarfile.XHDTYPE, 400 * 2**20
    with gzip.open(path, "wb", compresslevel=1) as file:
        file.write(header.tobuf(tarfile.USTAR_FORMAT))
        for _ in range(25):
            file.write(bytes(16 * 2**20))
    assert "not a PyTorch checkpoint" in refusal(path)
