/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Controllers of the kernel module, as incise info prints them.
 */
#ifndef INCISE_STEPPER_MODULE_TOOL_H
#define INCISE_STEPPER_MODULE_TOOL_H

#include <stdbool.h>

/* Whether it is "stepper", for all controllers, or the path of one. */
bool stepper_module_is(const char *what);

/* Print it; fails the program without a module. */
void stepper_module_show(const char *what, bool json);

#endif
