"""Tokens and seals: only a private file is taken, and only what was signed with its token."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.wire.authentication import read_token, sign, verify
from motiondeck_base.errors import MotiondeckError

TOKEN = b"0123456789abcdef"


@given(st.binary(max_size=300))
def test_a_signature_is_verified_with_the_same_token_only(data):
    assert verify(TOKEN, sign(TOKEN, data)) == data
    assert verify(b"another token 16", sign(TOKEN, data)) is None


@given(st.binary(max_size=100), st.integers(0, 2000))
def test_no_bit_may_be_changed(data, place):
    signed = bytearray(sign(TOKEN, data))
    signed[place // 8 % len(signed)] ^= 1 << place % 8
    assert verify(TOKEN, bytes(signed)) is None


@given(st.binary(max_size=100))
def test_what_was_never_signed_is_not_taken(data):
    assert verify(TOKEN, data) is None


@pytest.fixture
def file(tmp_path):
    file = tmp_path / "token"
    file.write_bytes(TOKEN + b"\n")
    file.chmod(0o600)
    return file


def test_a_private_file_is_read(file):
    assert read_token(file) == TOKEN


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o666])
def test_a_file_that_others_may_use_is_refused(file, mode):
    file.chmod(mode)
    with pytest.raises(MotiondeckError, match="chmod 600"):
        read_token(file)


def test_a_short_token_and_no_token_are_refused_with_a_way_to_make_one(file, tmp_path):
    file.write_bytes(b"short")
    with pytest.raises(MotiondeckError, match="at least 16 characters, not 5"):
        read_token(file)
    with pytest.raises(MotiondeckError, match="openssl rand"):
        read_token(tmp_path / "nothing")
    with pytest.raises(MotiondeckError):
        read_token(tmp_path)
