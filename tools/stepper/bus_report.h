/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise info of a bus: the devices that a backend finds on it.
 */
#ifndef INCISE_BUS_REPORT_H
#define INCISE_BUS_REPORT_H

#include <stdbool.h>

/*
 * "BACKEND:…", such as can:can0. A model or a recording may have a colon in its name, and
 * is known by how that ends.
 */
bool bus_report_is(const char *what);

/* Ends the program with 1 and one line when nothing is found. */
void bus_report_show(const char *what, bool json);

/* All that is attached, of each kind; nothing is an answer too. */
void bus_report_show_attached(bool json);

#endif
