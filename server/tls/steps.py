"""The steps for trusting our authority on each platform, with the picture of each step.

Menu names are those of 2026; where they differ, the steps give search terms for the settings.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Mark = Literal["", "press", "on", "chosen"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A line of a drawn screen: to press, a switch that is on, one of several that is chosen, or only there."""

    lines: tuple[str, ...]  # at most 21 letters each
    mark: Mark = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Screen:
    """A drawn screen or window, so far as it matters for the step."""

    head: str
    rows: tuple[Row, ...]
    is_window: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One instruction and its picture."""

    title: str
    text: str
    screen: Screen | None = None
    file: Literal["", "ca.crt", "ca.mobileconfig"] = ""  # to be had at this step
    command: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Platform:
    """One kind of device or browser."""

    id: str
    name: str
    browsers: str
    steps: tuple[Step, ...]
    removal: str  # how to take it off again


def _row(text: str, mark: Mark = "") -> Row:
    return Row(lines=tuple(text.split("|")), mark=mark)


def _phone(head: str, *rows: Row) -> Screen:
    return Screen(head=head, rows=rows)


def _window(head: str, *rows: Row) -> Screen:
    return Screen(head=head, rows=rows, is_window=True)


PLATFORMS = (
    Platform(
        id="android",
        name="Android",
        browsers="Chrome, Edge, Samsung Internet, Brave",
        steps=(
            Step(
                title="Download the certificate",
                text="Keep the file when the browser prompts. It does not open by itself.",
                screen=_phone("Downloads", _row("catgraph-ca.crt", "chosen"), _row("Keep", "press")),
                file="ca.crt",
            ),
            Step(
                title="Find “CA certificate” in Settings",
                text="Open the phone's Settings and search for CA certificate. By hand: Security & privacy, More "
                "security settings, Encryption & credentials, Install a certificate. The phone must have a screen "
                "lock.",
                screen=_phone(
                    "Install a certificate",
                    _row("CA certificate", "press"),
                    _row("VPN & app user|certificate"),
                    _row("Wi-Fi certificate"),
                ),
            ),
            Step(
                title="Install anyway",
                text="The phone warns that traffic could be read. This authority is bound to private addresses; for "
                "any site of the internet it is worth nothing.",
                screen=_phone("Your data won't be|private", _row("Don't install"), _row("Install anyway", "press")),
            ),
            Step(
                title="Choose the file",
                text="catgraph-ca.crt, in Downloads. The phone reports that a CA certificate is installed.",
                screen=_phone("Downloads", _row("catgraph-ca.crt", "press"), _row("photo.jpg")),
            ),
        ),
        removal="Settings, search for Trusted credentials, User, the catgraph line, Remove.",
    ),
    Platform(
        id="iphone",
        name="iPhone and iPad",
        browsers="Safari; Chrome and others after it",
        steps=(
            Step(
                title="Download the profile",
                text="In Safari, not in another browser. Press Allow, then Close.",
                screen=_phone(
                    "This website is trying|to download a|configuration profile",
                    _row("Allow", "press"),
                    _row("Ignore"),
                ),
                file="ca.mobileconfig",
            ),
            Step(
                title="Install it",
                text="Settings, Profile Downloaded near the top (later under General, VPN & Device Management), "
                "Install, your passcode, Install again. “Not Signed” is right: compare the fingerprint under More "
                "Details.",
                screen=_phone("Settings", _row("Profile Downloaded", "press"), _row("Airplane Mode"), _row("Wi-Fi")),
            ),
            Step(
                title="Trust it: the step that is forgotten",
                text="Settings, General, About, at the very end Certificate Trust Settings. Switch the catgraph line "
                "on, Continue. Without this the profile is installed and Safari still warns.",
                screen=_phone("Certificate|Trust Settings", _row("catgraph …", "on"), _row("Continue", "press")),
            ),
        ),
        removal="Settings, General, VPN & Device Management, the catgraph profile, Remove Profile.",
    ),
    Platform(
        id="windows",
        name="Windows",
        browsers="Edge, Chrome",
        steps=(
            Step(
                title="Download the certificate and open it",
                text="Press Install Certificate, then Current User.",
                screen=_window("Certificate", _row("Issued to: catgraph …"), _row("Install Certificate…", "press")),
                file="ca.crt",
            ),
            Step(
                title="Choose the store by hand",
                text="“Place all certificates in the following store”, Browse, Trusted Root Certification Authorities.",
                screen=_window(
                    "Select store",
                    _row("Personal"),
                    _row("Trusted Root|Certification Author…", "press"),
                    _row("Enterprise Trust"),
                ),
            ),
            Step(
                title="Say Yes to the question",
                text="Windows names the authority and prompts. Finish, then close and open the browser.",
                screen=_window("Security Warning", _row("catgraph …"), _row("Yes", "press"), _row("No")),
            ),
        ),
        removal="Run certmgr.msc, Trusted Root Certification Authorities, Certificates, delete the catgraph line.",
    ),
    Platform(
        id="macos",
        name="Mac",
        browsers="Safari, Chrome, Edge",
        steps=(
            Step(
                title="Download the certificate and open it",
                text="Keychain Access takes it into the login keychain. There, open the catgraph line.",
                screen=_window("Keychain Access", _row("login", "chosen"), _row("catgraph …", "press")),
                file="ca.crt",
            ),
            Step(
                title="Always Trust",
                text="Open Trust, choose Always Trust, close the window and give your password.",
                screen=_window("Trust", _row("When using this|certificate:"), _row("Always Trust", "press")),
            ),
        ),
        removal="Keychain Access, login, Certificates, delete the catgraph line.",
    ),
    Platform(
        id="linux",
        name="Linux",
        browsers="Chrome, Chromium, Brave",
        steps=(
            Step(
                title="Download the certificate",
                text="It is in Downloads as catgraph-ca.crt.",
                file="ca.crt",
            ),
            Step(
                title="Import it",
                text="Open chrome://certificate-manager in the browser: Local certificates, Custom, Installed by you, "
                "Trusted Certificates, Import.",
                screen=_window(
                    "Certificate Manager",
                    _row("Local certificates", "chosen"),
                    _row("Trusted Certificates"),
                    _row("Import", "press"),
                ),
            ),
            Step(
                title="Or by command",
                text="With libnss3-tools, for Chromium's own store:",
                command='certutil -d sql:"$HOME/.pki/nssdb" -A -t C,, -n catgraph -i catgraph-ca.crt',
            ),
        ),
        removal="The same place, Delete; or certutil -D with -n catgraph.",
    ),
    Platform(
        id="firefox",
        name="Firefox",
        browsers="on Linux and Android; elsewhere it follows the system",
        steps=(
            Step(
                title="On a computer: import it as an authority",
                text="Settings, search for certificates, View Certificates, Authorities, Import. Tick “Trust this CA "
                "to identify websites”.",
                screen=_window(
                    "Downloading|Certificate",
                    _row("Trust this CA to|identify websites", "on"),
                    _row("OK", "press"),
                ),
                file="ca.crt",
            ),
            Step(
                title="On Android: let it use the phone's",
                text="Do the steps for Android first. Then in Firefox: Settings, About Firefox, press the logo five "
                "times, back, Secret Settings, switch on Use third party CA certificates.",
                screen=_phone("Secret Settings", _row("Use third party|CA certificates", "on")),
            ),
        ),
        removal="The same place, the catgraph line, Delete or Distrust.",
    ),
)


def platform_of(agent: str) -> str:
    """The platform id for a User-Agent; an unknown one counts as Android."""
    agent = agent.lower()
    is_phone = "android" in agent
    if "firefox" in agent and not ("windows" in agent or "mac os" in agent):
        return "firefox"
    if "iphone" in agent or "ipad" in agent:
        return "iphone"
    if not is_phone:
        for name, id in (("windows", "windows"), ("mac os", "macos"), ("linux", "linux"), ("x11", "linux")):
            if name in agent:
                return id
    return "android"
