// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The statement of a recording, or what differs from one, for forgeries.py.
 *
 *     statement NAME.rec            print its statement
 *     statement NAME.rec FILE       compare: a line "PART FIRST LAST TEXT" for each finding, with
 *                                   - for no part and -1 for no place; exit status 0: sealed
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/seal.h>

static void found(void *unused, const struct incise_verify_finding *finding)
{
	(void)unused;
	printf("%s %lld %lld %s\n", *finding->stream ? finding->stream : "-",
	       (long long)finding->first_block, (long long)finding->last_block,
	       finding->text);
}

int main(int argc, char **argv)
{
	const struct incise_verify_watch watch = {.found = found};
	struct incise_verify_report report;
	struct incise_error err = {0};
	static char text[1 << 20];
	char *made;
	FILE *file;
	size_t n;

	if (argc == 2) {
		made = incise_seal_statement(argv[1], &err);
		if (made)
			fputs(made, stdout);
		else
			fprintf(stderr, "%s\n", err.text);
		free(made);
		return made ? 0 : 1;
	}
	file = argc == 3 ? fopen(argv[2], "r") : NULL;
	if (!file) {
		fprintf(stderr, "usage: statement NAME.rec [FILE]\n");
		return 2;
	}
	n = fread(text, 1, sizeof(text), file);
	fclose(file);
	if (incise_seal_compare(argv[1], text, n, &watch, &report, &err)) {
		printf("error -1 -1 %s\n", err.text);
		return 1;
	}
	return report.sealed && report.intact ? 0 : 1;
}
