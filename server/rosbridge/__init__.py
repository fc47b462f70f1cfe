"""The client of a rosbridge server, and the gate that checks all that is sent to one."""

import os

os.environ.setdefault("ROSLIBPY_TRANSPORT", "asyncio")  # before anything lets txaio choose Twisted for the process
