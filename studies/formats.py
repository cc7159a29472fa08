"""The formats of tables, under the name by which users' own packages know them."""

from tympan.geometry.formats import FORMATS as FORMATS
from tympan.geometry.formats import Format as Format
from tympan.geometry.formats import Row as Row
from tympan.geometry.formats import decimal_point as decimal_point
from tympan.geometry.formats import decoded as decoded
from tympan.geometry.formats import first_line as first_line
from tympan.geometry.formats import format_of as format_of
from tympan.geometry.formats import read_rows as read_rows
from tympan.geometry.formats import suffixes as suffixes
from tympan.geometry.formats import text_rows as text_rows
from tympan.geometry.formats import unfolded as unfolded
from tympan.geometry.formats import workbook_rows as workbook_rows
