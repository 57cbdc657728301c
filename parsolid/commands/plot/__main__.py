"""`python -m parsolid.commands.plot DIR`: the standard pictures of a run, without MPI; exit status 2 with one message
if they cannot be drawn.
"""

import sys

from parsolid.commands.plot.command import standard
from parsolid.exit_status import BAD_INPUT
from parsolid.scene import SceneError

if __name__ == "__main__":
    try:
        standard(sys.argv[1])
    except (SceneError, OSError) as error:
        print(error, file=sys.stderr)
        sys.exit(BAD_INPUT)
