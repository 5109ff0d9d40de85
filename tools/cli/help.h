/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * --help of a command, wrapped to the width of standard output, and the same table as data.
 */
#ifndef INCISE_HELP_H
#define INCISE_HELP_H

#include "cli.h"

/* Option @i of a command, then those that all commands have; NULL: there are no more. */
const struct cli_option *help_option(const struct cli_command *command, int i);

void help_print(const struct cli_command *command);

/*
 * Print the table from which mk/manual makes a page, a line each:
 *
 *     option<TAB>LETTER<TAB>NAME<TAB>ARGUMENT<TAB>HELP    LETTER and ARGUMENT may be empty
 *     exit<TAB>STATUS<TAB>MEANING
 */
void help_print_table(const struct cli_command *command);

/*
 * Print lines that begin at column @at; where one is too long, it goes on at @indent, or, if it has
 * two blanks in a row, below what follows them.
 */
void help_print_text(const char *text, int at, int indent);

#endif
