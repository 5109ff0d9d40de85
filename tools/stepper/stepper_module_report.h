/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise info of the kernel module's controllers.
 */
#ifndef INCISE_STEPPER_MODULE_REPORT_H
#define INCISE_STEPPER_MODULE_REPORT_H

#include <stdbool.h>

/* "stepper", for all there are, or the path of one. */
bool stepper_module_is(const char *what);

/* Ends the program with 1 and one line when there is none. */
void stepper_module_show(const char *what, bool json);

#endif
