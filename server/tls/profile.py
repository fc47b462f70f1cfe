"""Our authority as a configuration profile, the form in which an iPhone, an iPad and a Mac take one."""

from __future__ import annotations

import plistlib
import uuid

from server.tls.authority import Authority

MEDIA_TYPE = "application/x-apple-aspen-config"
_OURS = uuid.UUID("5a1d3c5e-60a5-4f0c-9a44-4a0f9fb1f7a5")  # under it the ids of all our profiles are made


def mobileconfig(authority: Authority) -> bytes:
    """The profile, unsigned, because the signer would not be trusted yet. An authority always has the same ids, so that
    a second installation replaces the first."""
    id = authority.fingerprint.replace(":", "").lower()
    root = {
        "PayloadType": "com.apple.security.root",
        "PayloadVersion": 1,
        "PayloadIdentifier": f"catgraph.{id[:16]}.authority",
        "PayloadUUID": str(uuid.uuid5(_OURS, f"{id} authority")).upper(),
        "PayloadDisplayName": authority.name,
        "PayloadDescription": "Lets this device trust the page of one catgraph server. Private addresses only.",
        "PayloadCertificateFileName": "catgraph-ca.crt",
        "PayloadContent": authority.der,
    }
    profile = {
        "PayloadType": "Configuration",
        "PayloadVersion": 1,
        "PayloadIdentifier": f"catgraph.{id[:16]}",
        "PayloadUUID": str(uuid.uuid5(_OURS, f"{id} profile")).upper(),
        "PayloadDisplayName": authority.name,
        "PayloadDescription": "Then switch it on in Settings, General, About, Certificate Trust Settings.",
        "PayloadRemovalDisallowed": False,
        "PayloadContent": [root],
    }
    return plistlib.dumps(profile)
