"""`python -m parsolid.commands.plot DIR`: the pictures at a run's end, without MPI; exit status 2 with one line when
there are none.
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
