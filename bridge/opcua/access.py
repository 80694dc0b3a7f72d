"""Who may read: anybody on the loopback interface; elsewhere, or if asked for, who has the password, over an encrypted
channel with a certificate that is made the first time. Nobody may write (bridge/29)."""

from __future__ import annotations

import socket
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from asyncua import Server, ua
from asyncua.crypto import cert_gen
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.server.user_managers import UserManager
from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding
from cryptography.x509.oid import ExtendedKeyUsageOID

from isel_twin.base.files import atomic_write, replacing
from isel_twin.bridge.operate.token import is_token

DAYS = 3650  # a certificate is valid
KEY, CERTIFICATE = "key.pem", "certificate.der"


@dataclass(frozen=True)
class Access:
    """folder: holds key and certificate, made when missing. password: of every user."""

    folder: Path
    password: str


class Readers(UserManager):
    """Lets readers in: with the password, or anybody if there is none."""

    def __init__(self, password: str | None) -> None:
        self._password = password

    def get_user(
        self, iserver: Any, username: str | None = None, password: str | None = None, certificate: Any = None
    ) -> User | None:
        return User(UserRole.User, username) if is_token(password, self._password) else None


def _uri() -> str:
    """Of the server on this computer."""
    return f"urn:{socket.gethostname()}:isel-twin"


def _uri_in(certificate: Path) -> str:
    """What clients compare with the server's. Raises OSError, ValueError."""
    try:
        names = x509.load_der_x509_certificate(certificate.read_bytes()).extensions
        found = names.get_extension_for_class(x509.SubjectAlternativeName).value
        return found.get_values_for_type(x509.UniformResourceIdentifier)[0]
    except (ValueError, x509.ExtensionNotFound, IndexError):
        raise ValueError(f"{certificate}: no certificate (DER) with the URI of an OPC UA application") from None


async def secure(server: Server, access: Access | None) -> None:
    """Set what the server demands. Raises OSError, ValueError for files that are no key and certificate."""
    await server.set_application_uri(_uri())
    if access is None:
        server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
        server.set_identity_tokens([ua.AnonymousIdentityToken])
        return
    if not (access.folder / KEY).exists():
        _make(access.folder)
    await server.set_application_uri(_uri_in(access.folder / CERTIFICATE))  # it may be of another computer
    await server.load_private_key(access.folder / KEY)
    await server.load_certificate(access.folder / CERTIFICATE)
    server.set_security_policy([ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt])
    server.set_identity_tokens([ua.UserNameIdentityToken])


def _make(folder: Path) -> None:
    """Write a new key, for its owner's eyes only, and a certificate signed by itself."""
    folder.mkdir(parents=True, exist_ok=True)
    key = cert_gen.generate_private_key()
    names: list[x509.GeneralName] = [
        x509.UniformResourceIdentifier(_uri()),
        x509.DNSName(socket.gethostname()),
    ]
    use = [ExtendedKeyUsageOID.SERVER_AUTH]
    made = cert_gen.generate_self_signed_app_certificate(key, "isel-twin", {}, names, use, DAYS)
    atomic_write(folder / CERTIFICATE, made.public_bytes(Encoding.DER))
    with replacing(folder / KEY, 0o600) as file:
        file.write(cert_gen.dump_private_key_as_pem(key))
