// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * sqlite3 for tests: SQL on a recording as if it had a row a sample; see rows_sql.h.
 *
 *     sql [-readonly] [-separator TEXT] FILE [SQL]		SQL may come from stdin
 */
#include <stdio.h>
#include <stdlib.h>
#include "../rows_sql.h"

static void print(void *separator, sqlite3_stmt *stmt)
{
	for (int i = 0; i < sqlite3_column_count(stmt); i++) {
		const char *text = (const char *)sqlite3_column_text(stmt, i);

		printf("%s%s", i ? (const char *)separator : "", text ? text : "");
	}
	putchar('\n');
}

int main(int argc, char **argv)
{
	char *separator = "|", *message, *sql = NULL;
	bool readonly = false;
	size_t size = 0;
	int at = 1, rc;

	for (; at < argc && argv[at][0] == '-'; at++) {
		if (!strcmp(argv[at], "-readonly"))
			readonly = true;
		else if (!strcmp(argv[at], "-separator") && at + 1 < argc)
			separator = argv[++at];
		else
			return fprintf(stderr, "sql: unknown %s\n", argv[at]), 2;
	}
	if (at == argc)
		return fputs("sql: give a file\n", stderr), 2;
	if (at + 1 < argc)
		sql = argv[at + 1];
	else if (getdelim(&sql, &size, EOF, stdin) < 0)
		return 2;
	rc = rows_sql(argv[at], readonly, sql, print, separator, &message);
	if (rc)
		fprintf(stderr, "Error: %s: %s\n", argv[at], message);
	return rc ? 1 : 0;
}
