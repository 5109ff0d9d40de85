/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A command of incise stepper, and what was asked of it.
 */
#ifndef INCISE_STEPPER_COMMAND_H
#define INCISE_STEPPER_COMMAND_H

#include <stdbool.h>
#include <jansson.h>
#include "../cli/cli.h"
#include "stepper_drive.h"

struct stepper_job {
	const struct stepper_command *command;
	const char *rig;
	double amount; /* the operand: mm or mm/s */
	bool follow, by, unhomed, hold, json;
	double seconds; /* 0: until Ctrl-C */
	int repeat;	/* 0: not given */
};

/* Runs on an open drive; ends the program with 1 and a line when it fails. */
typedef void stepper_run(const struct stepper_job *job, struct stepper_drive *drive);

struct stepper_command {
	const char *name;
	const char *operand;	      /* its name, or NULL */
	const struct cli_unit *units; /* of it */
	stepper_run *run;
	bool watch;	   /* does not become the owner */
	const char *takes; /* letters of options, see incise-stepper.c */
};

/* The command's name, and where it stands. */
json_t *stepper_report(const struct stepper_job *job, const struct stepper_drive *drive);

/* Print it at once and release it. Ends nothing: the motor may have power. */
void stepper_put(json_t *object, size_t form);

stepper_run stepper_enable, stepper_move, stepper_jog, stepper_home;

#endif
