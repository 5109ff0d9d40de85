/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The emulator as a function of USB: a folder where FunctionFS is mounted becomes an interface
 * with a bulk OUT, a bulk IN and an interrupt IN.
 */
#ifndef INCISE_TEST_POLHEMUS_USB_FUNCTION_H
#define INCISE_TEST_POLHEMUS_USB_FUNCTION_H

#include "emulator.h"

/* Prints "ready usb" once the gadget can be bound; @command is called for standard input. */
int usb_function(struct emulator *e, const char *folder, bool (*command)(void));

#endif
