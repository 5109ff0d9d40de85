/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The keys of configuration files, with their values.
 */
#ifndef INCISE_SETTINGS_API_H
#define INCISE_SETTINGS_API_H

#include <stdbool.h>

/** A key of rig.conf or a scene, and its value. */
struct incise_key {
	char name[80]; /**< "sim.seed"; "actuator[2].lead_mm" of several, from 1 on */
	/**
	 * as in the file and in JSON: 2.5, true, "text", [0, 0, 1]; empty: no value, or the
	 * device's own
	 */
	char value[400];
	const char *unit; /**< of its numbers: "N/mm"; "" without a unit */
	const char *help; /**< one sentence */
	bool given;	  /**< in the file; else the default */
	int line;	  /**< line in the file; 0: not in the file */
};

/**
 * Called for each key. @key is valid until the function returns.
 * @return 0; another value ends the list, and the list's function returns it
 */
typedef int incise_key_found(void *context, const struct incise_key *key);

#endif
