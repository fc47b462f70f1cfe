"""How mail leaves this server: host, login, sender, who may be written to. One file of mode 0600."""

from __future__ import annotations

import contextlib
import ipaddress
import os
import re
import ssl
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, get_args
from urllib.parse import urlsplit

import tomli_w

from server.mail import address
from server.mail.compose import is_one_line
from server.storage import bounded_toml, durable_file
from server.storage.durable_file import set_aside

Security = Literal["starttls", "tls", "none"]
USUAL_PORT: Mapping[str, int] = {"starttls": 587, "tls": 465, "none": 25}
# Base64 in lines makes 1.37 of 1: 18 MB are 24.7 MB of mail, and most providers take 25.
LIMIT_MB = 18.0
_LIMITS_MB = (0.1, 50.0)
MOST_REPORT_TO = 20
_MAX_FILE = 128 * 1024
_MAX_CA = 32 * 1024
_HOST = re.compile(r"(?=.{1,253}\Z)[A-Za-z0-9]([A-Za-z0-9-]*[A-Za-z0-9])?(\.[A-Za-z0-9]([A-Za-z0-9-]*[A-Za-z0-9])?)*")


class BadMailSetting(ValueError):
    """A value that cannot be set; `str()` is one sentence, `field` which it is."""

    def __init__(self, field: str, sentence: str) -> None:
        super().__init__(sentence)
        self.field = field


@dataclass(frozen=True, slots=True, kw_only=True)
class MailSettings:
    """One state of the settings; the defaults send nothing."""

    host: str = ""
    port: int = 587
    security: Security = "starttls"
    user: str = ""  # empty: no login
    password: str = field(default="", repr=False)
    sender: str = ""
    sender_name: str = ""
    allowed: tuple[str, ...] = ()  # empty: everyone
    report_to: tuple[str, ...] = ()  # who gets the report of each drive by itself; empty: nobody
    limit_mb: float = LIMIT_MB  # raw size of what is attached to one mail [10⁶ bytes]
    link_base: str = ""  # this server's address in links; empty: the address of the ordering page
    ca: str = ""  # PEM; only these are trusted then

    @property
    def is_complete(self) -> bool:
        """Whether anything can be sent."""
        return bool(self.host and self.sender)

    @property
    def limit_bytes(self) -> int:
        return int(self.limit_mb * 1e6)

    @property
    def account(self) -> tuple[str, int, str]:
        """The account of the password."""
        return self.host.lower(), self.port, self.user


def checked(body: Mapping[str, Any], old: MailSettings) -> MailSettings:
    """The settings in `body`, which names all but the password; without one the old password stays.

    A password is bound to its account: another host, port or user, or a change from TLS to none, needs it again.
    Raises BadMailSetting.
    """
    given = body.get("password")
    bare = MailSettings(
        host=_host(str(body.get("host", ""))),
        port=_port(body.get("port", 587)),
        security=_security(body.get("security", "starttls")),
        user=_line("user", str(body.get("user", "")), 320),
        password=old.password if given is None else _password(str(given)),
        sender=_sender(str(body.get("sender", ""))),
        sender_name=_line("sender_name", str(body.get("sender_name", "")), 100).strip(),
        allowed=_allowed(body.get("allowed", ())),
        report_to=_report_to(body.get("report_to", ())),
        limit_mb=_limit(body.get("limit_mb", LIMIT_MB)),
        link_base=_link_base(str(body.get("link_base", "")).strip()),
        ca=_ca(str(body.get("ca", ""))),
    )
    if not bare.user:
        bare = replace(bare, password="")
    if given is None and bare.password and (bare.account != old.account or _is_weaker(bare, old)):
        raise BadMailSetting("password", f"Enter the password again: it was for {old.user} at {old.host}:{old.port}.")
    if bare.password and bare.security == "none" and not _is_this_machine(bare.host):
        raise BadMailSetting("security", "Without TLS the password can be intercepted: choose STARTTLS or TLS.")
    return bare


def _is_weaker(new: MailSettings, old: MailSettings) -> bool:
    return (new.security == "none" and old.security != "none") or new.ca != old.ca


def _host(text: str) -> str:
    text = text.strip()
    if not text:
        return ""
    try:
        return str(ipaddress.ip_address(text))
    except ValueError:
        pass
    try:
        text = text if text.isascii() else address.parse_domain(text)
    except address.BadAddress:
        text = ""
    if not _HOST.fullmatch(text):
        raise BadMailSetting("host", "The SMTP host is a name or an IP address, such as smtp.example.org.")
    return text


def _port(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= 65535:
        raise BadMailSetting("port", "The port is a number from 1 to 65535.")
    return value


def _security(value: Any) -> Security:
    if value not in get_args(Security):
        raise BadMailSetting("security", "The security is starttls, tls or none.")
    found: Security = value
    return found


def _line(name: str, text: str, most: int) -> str:
    if len(text) > most or not is_one_line(text):
        raise BadMailSetting(name, f"This is one line of at most {most} printable characters.")
    return text


def _password(text: str) -> str:
    if len(text) > 500 or any(ord(letter) < 32 or ord(letter) == 127 for letter in text) or not _is_text(text):
        raise BadMailSetting("password", "A password is one line of at most 500 letters.")
    return text


def _sender(text: str) -> str:
    if not text.strip():
        return ""
    try:
        return address.parse(text.strip()).text
    except address.BadAddress as why:
        raise BadMailSetting("sender", str(why)) from None


def _allowed(value: Any) -> tuple[str, ...]:
    if not isinstance(value, (list, tuple)) or len(value) > 200 or not all(isinstance(one, str) for one in value):
        raise BadMailSetting("allowed", "Allowed recipients are at most 200 addresses or domains.")
    try:
        return tuple(dict.fromkeys(address.parse_allowed(one.strip()) for one in value if one.strip()))
    except address.BadAddress as why:
        raise BadMailSetting("allowed", str(why)) from None


def _report_to(value: Any) -> tuple[str, ...]:
    if (
        not isinstance(value, (list, tuple))
        or len(value) > MOST_REPORT_TO
        or not all(isinstance(x, str) for x in value)
    ):
        raise BadMailSetting("report_to", f"Drive reports are mailed to at most {MOST_REPORT_TO} addresses.")
    try:
        return tuple(dict.fromkeys(address.parse(one.strip()).text for one in value if one.strip()))
    except address.BadAddress as why:
        raise BadMailSetting("report_to", str(why)) from None


def _limit(value: Any) -> float:
    low, high = _LIMITS_MB
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise BadMailSetting("limit_mb", f"The limit of a mail is {low:g} to {high:g} MB.")
    return float(value)


def _link_base(text: str) -> str:
    if not text:
        return ""
    try:
        parts = urlsplit(text)
        is_good = (
            parts.scheme in ("http", "https")
            and bool(parts.hostname)
            and parts.username is None
            and parts.port != 0
            and re.fullmatch(r"[A-Za-z0-9:/._~%\[\]-]{1,300}", text) is not None
        )
    except ValueError:
        is_good = False
    if not is_good:
        raise BadMailSetting("link_base", "The address for links must look like http://192.168.4.1:8000.")
    return text.rstrip("/")


def _ca(text: str) -> str:
    text = text.strip()
    if not text:
        return ""
    if len(text) > _MAX_CA or not text.isascii():
        raise BadMailSetting("ca", "The certificate must be PEM text of at most 32 kB.")
    try:
        ssl.create_default_context(cadata=text)
    except (ssl.SSLError, ValueError):
        raise BadMailSetting("ca", "This is not a PEM certificate.") from None
    return text + "\n"


def _is_text(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _is_this_machine(host: str) -> bool:
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class MailSettingsFile:
    """Where the settings are kept."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._is_unread = False  # what the file holds is not known: it is set aside before anything is written
        self.complaint: str | None = None  # why what was found could not be used

    def read(self) -> MailSettings:
        """What was kept, or the defaults. What cannot be used is set aside; what others may read is closed to them."""
        try:
            with open(self._path, "rb") as file:
                if os.fstat(file.fileno()).st_mode & 0o077:
                    os.fchmod(file.fileno(), 0o600)
                body = bounded_toml.loads(
                    file.read(_MAX_FILE), max_bytes=_MAX_FILE, max_line=_MAX_FILE
                )  # a certificate is a line
            kept = MailSettings(password=str(body.get("password", "")))
            return checked({**body, "password": kept.password}, kept)
        except FileNotFoundError:
            return MailSettings()
        except OSError as why:
            self._is_unread = True
            self.complaint = f"The mail settings cannot be read ({why.strerror or why}); nothing is sent."
            return MailSettings()
        except ValueError:
            aside = self._path
            self._is_unread = True
            with contextlib.suppress(OSError):
                aside = set_aside(self._path)
                self._is_unread = False
            self.complaint = f"The mail settings could not be used and are set aside as {aside.name}; set them again."
            return MailSettings()

    def write(self, settings: MailSettings) -> None:
        """Keeps them: whole or not at all, never readable for others. Raises OSError.

        A file that could not be read is set aside first; where that fails, nothing is written.
        """
        if self._is_unread:
            with contextlib.suppress(FileNotFoundError):
                set_aside(self._path)
            self._is_unread = False
        content = tomli_w.dumps(
            {**asdict(settings), "allowed": list(settings.allowed), "report_to": list(settings.report_to)}
        )
        durable_file.write(self._path, content.encode(), mode=0o600)
