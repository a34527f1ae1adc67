"""Checks of input: values with units, errors, synonyms of names, tables, files."""

from pyfric.values.calls import usage
from pyfric.values.checked import (
    FOR_EVER,
    Annotation,
    Name,
    NotNegative,
    OneOf,
    Positive,
    Quantity,
    Switches,
    Whole,
    Words,
    Written,
    annotations,
    from_entries,
    part,
    table,
)
from pyfric.values.errors import SceneError, naming, numbered, unknown
from pyfric.values.files import (
    check_folder_name,
    check_free,
    check_writable,
    clean_drafts,
    figure_stem,
    read_at_most,
    sealed,
    unsealed,
    write,
    write_all,
    written,
)
from pyfric.values.tables import (
    COMMA,
    NAMES,
    POINT,
    SCALED,
    THOUSANDS,
    Line,
    cells_of,
    fits,
    is_number,
    lines_of,
    separator_of,
    unit_among,
    unit_in,
)
from pyfric.values.toml import parsed
from pyfric.values.units import (
    LARGEST,
    PREFIXES,
    SMALLEST,
    as_list,
    check_number,
    check_unmasked,
    check_whole,
    parse_quantity,
    prefix_power,
    spoken,
    with_prefix,
)
from pyfric.values.words import GO_ON, LINES, line, meant, nearest, no_attribute, plain
