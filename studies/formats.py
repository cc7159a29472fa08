"""Formats of tables, under the name that users' own packages use."""

from tympan.tables.formats import FORMATS as FORMATS
from tympan.tables.formats import Format as Format
from tympan.tables.formats import Row as Row
from tympan.tables.formats import decimal_point as decimal_point
from tympan.tables.formats import decoded as decoded
from tympan.tables.formats import first_line as first_line
from tympan.tables.formats import format_of as format_of
from tympan.tables.formats import read_rows as read_rows
from tympan.tables.formats import suffixes as suffixes
from tympan.tables.formats import text_rows as text_rows
from tympan.tables.formats import unfolded as unfolded
from tympan.tables.formats import workbook_rows as workbook_rows
