"""Names of rows: they cover vectors and tables without overlap, and agree with the lattice."""

import numpy as np

from pyfric.statics.rows import ends, table_rows


def test_rows_cover_what_they_name():
    N_x, N_z = 5, 3
    at, table = ends(N_x), table_rows(N_x)
    u = np.arange(2 * N_x * N_z).reshape(N_z, 2, N_x)
    found = [u.ravel()[rows] for rows in at]
    np.testing.assert_array_equal(found, [u[0, 0], u[0, 1], u[-1, 0], u[-1, 1]])
    rows = [np.arange(table.shape[0])[named] for named in (table.u_x, table.f, table.u_z)]
    assert [*np.concatenate(rows), table.shape[0] + table.F_T] == [*range(table.shape[0])]
    columns = np.arange(table.shape[1])
    assert [*columns[table.u_x], *columns[table.given]] == [*columns]
    assert columns[table.drive] == columns[table.given][0]
