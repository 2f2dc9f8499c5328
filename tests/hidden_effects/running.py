"""Running a command of the test bench: errors become one line and an exit status."""

import sys

from cyclopts import App, CycloptsError

from vjm_output import terminal
from vjm_validation.cli import BAD_INPUT


def finish(app: App) -> None:
    """Run the command with the process's arguments and exit."""
    try:
        status = app(sys.argv[1:], exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as error:
        terminal.error(" ".join(str(error).split()))
        sys.exit(BAD_INPUT)
    except (ValueError, OSError) as error:
        terminal.error(terminal.one_line(error))
        sys.exit(BAD_INPUT)
    sys.exit(status)
