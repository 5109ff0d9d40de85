/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Words that may follow in a command line, for the completion of bash and zsh: tools/incise.bash
 * and tools/_incise run `incise --complete WORD…`, whose last word is to be completed. The words come
 * from the tables of options and from the synopsis that --help prints. A line each:
 *
 *     VALUE<TAB>DESCRIPTION    a word
 *     :files GLOB…             files with such names, and folders; all files without a GLOB
 *     :folders                 folders
 *     :nospace                 no blank follows a word
 */
#ifndef INCISE_COMPLETE_H
#define INCISE_COMPLETE_H

#include "cli.h"

/* Print a word; @description may be NULL. */
void complete_word(const char *word, const char *description);

/*
 * Print what the last of @n words may be, which follow the command's name.
 *
 * @choices prints the choices of an option that a function parses, and may end the program
 */
void complete_command(const struct cli_command *command, int n, char **words,
		      void (*choices)(const struct cli_option *option));

#endif
