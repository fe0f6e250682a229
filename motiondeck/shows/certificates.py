"""Certificates of a show: a folder for each member, and one authority, whose key stays in the show's folder."""

import datetime
import ipaddress
from collections.abc import Mapping
from itertools import combinations
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from motiondeck.shows.membership import AUTHORITY, CERTIFICATE, CONDUCTOR, KEY, MEMBER_FILE, check_name, host_and_port
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.files import write_file

YEARS = 5  # how long certificates are valid. They begin a day early, for machines whose clocks are behind.
AUTHORITY_KEY = "authority.key"
OWNERS = 0o600  # only the owner may read the files
_Authority = tuple[x509.Certificate, ec.EllipticCurvePrivateKey]


def make_certificates(folder: Path, show: str, members: Mapping[str, str]) -> list[Path]:
    """Makes a folder for each member with its address, HOST or HOST:PORT, the conductor too; the folders.

    With an authority that is there already, members are added or renewed. MotiondeckError if a name or an address is
    wrong, there is no conductor, or a file cannot be written.
    """
    check_name(show, "show")
    places = {check_name(name, "member of a show"): host_and_port(address) for name, address in members.items()}
    hosts = {name: host for name, (host, _) in places.items()}
    if CONDUCTOR not in hosts:
        raise MotiondeckError(f"give the address of the conductor too, such as {CONDUCTOR}=192.168.1.20")
    for (one, place), (other, same) in combinations(places.items(), 2):
        if place == same:
            host, port = place
            raise MotiondeckError(
                f"{one} and {other} have one address, {host}:{port}; give another port: {other}={host}:{port + 1}"
            )
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        authority = _authority(folder, show)
        return [_make_member(folder, show, name, hosts[name], members, authority) for name in hosts]
    except OSError as error:
        raise MotiondeckError.unwritable(error.filename, error) from None


def _make_member(
    folder: Path, show: str, name: str, host: str, members: Mapping[str, str], authority: _Authority
) -> Path:
    key = ec.generate_private_key(ec.SECP256R1())
    certificate = (
        _builder(show, name, key, authority[0].subject)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.SubjectAlternativeName([_place(host)]), critical=False)
        .add_extension(
            x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]), critical=False
        )
    )
    own = folder / name
    own.mkdir(mode=0o700, exist_ok=True)
    write_file(own / AUTHORITY, _pem(authority[0]), mode=OWNERS)
    write_file(own / CERTIFICATE, _pem(certificate.sign(authority[1], hashes.SHA256())), mode=OWNERS)
    write_file(own / KEY, _pem(key), mode=OWNERS)
    # Names and addresses hold nothing that TOML would have to escape: `check_name`, `host_and_port`.
    lines = [f'show = "{show}"', f'name = "{name}"', "", "[members]"]
    lines += [f'{other} = "{address}"' for other, address in members.items()]
    write_file(own / MEMBER_FILE, "\n".join([*lines, ""]).encode(), mode=OWNERS)
    return own


def _authority(folder: Path, show: str) -> _Authority:
    certificate_file, key_file = folder / AUTHORITY, folder / AUTHORITY_KEY
    if certificate_file.is_file() and key_file.is_file():
        try:
            certificate = x509.load_pem_x509_certificate(certificate_file.read_bytes())
            key = serialization.load_pem_private_key(key_file.read_bytes(), None)
        except ValueError as error:
            raise MotiondeckError(f"{folder}: its authority is damaged ({error}); give a new folder") from None
        if not isinstance(key, ec.EllipticCurvePrivateKey):
            raise MotiondeckError(f"{key_file}: this key is of another kind; give a new folder")
        return certificate, key
    key = ec.generate_private_key(ec.SECP256R1())
    usage = dict.fromkeys(
        ("digital_signature", "content_commitment", "key_encipherment", "data_encipherment", "key_agreement"), False
    )
    builder = (
        _builder(show, "authority", key, None)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(
            x509.KeyUsage(**usage, key_cert_sign=True, crl_sign=True, encipher_only=False, decipher_only=False),
            critical=True,
        )
    )
    certificate = builder.sign(key, hashes.SHA256())
    write_file(key_file, _pem(key), mode=OWNERS)
    write_file(certificate_file, _pem(certificate), mode=OWNERS)
    return certificate, key


def _builder(
    show: str, name: str, key: ec.EllipticCurvePrivateKey, issuer: x509.Name | None
) -> x509.CertificateBuilder:
    names = {NameOID.ORGANIZATION_NAME: show, NameOID.COMMON_NAME: name}
    subject = x509.Name([x509.NameAttribute(kind, text) for kind, text in names.items()])
    now = datetime.datetime.now(datetime.UTC)
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer or subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(days=1))
        .not_valid_after(now + datetime.timedelta(days=365 * YEARS))
    )


def _place(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        return x509.DNSName(host)


def _pem(thing: x509.Certificate | ec.EllipticCurvePrivateKey) -> bytes:
    if isinstance(thing, x509.Certificate):
        return thing.public_bytes(serialization.Encoding.PEM)
    return thing.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
