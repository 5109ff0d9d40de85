/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Another verb of incise, run as a person would run it: beside this program, its messages with
 * ours, and a Ctrl-C for both. argv[0] is its name, "train" say.
 */
#ifndef INCISE_VERB_H
#define INCISE_VERB_H

#include <jansson.h>
#include <incise/error.h>

/* Print the command. */
void verb_say(char *const *argv);

/* Run it to its end. 0, or -ECANCELED with "'incise train' failed, …"; fails the program. */
int verb_run(char *const *argv, struct incise_error *err);

/* The same, and read the JSON that it prints; NULL with the error. */
json_t *verb_report(char *const *argv, struct incise_error *err);

#endif
