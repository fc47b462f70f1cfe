"""`python -m tests.page.patient_server serve …`: a server for which silence grants no request and ends no control.

What is pressed in a prompt is pressed in time also on a machine that halts.
"""

import sys

from server.control import lease

lease.ANSWER_S = lease.LEASE_S = 120.0  # before others take them

from server.cli.main import main  # noqa: E402

if __name__ == "__main__":
    sys.exit(main())
