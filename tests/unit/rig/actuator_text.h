/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The group `actuator` of a rig.conf, from text: as a person meets it. */
#ifndef TEST_ACTUATOR_TEXT_H
#define TEST_ACTUATOR_TEXT_H

#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include "../../../lib/rig/actuator.h"

#define NEEDED "spring_N_mm = 2.0; travel_mm = 20.0; lead_mm = 2.0; "

/* @inside starts in line 2, behind what is @needed. */
static int actuator_read(struct incise_actuator *actuator, const char *needed,
			 const char *inside, struct incise_error *err)
{
	char text[2000];
	config_t config;
	int rc;

	snprintf(text, sizeof(text), "actuator = { %s\n%s\n};", needed, inside);
	config_init(&config);
	assert_true(config_read_string(&config, text));
	rc = incise_actuator_read(actuator, config_lookup(&config, "actuator"), "r", err);
	config_destroy(&config);
	return rc;
}

static struct incise_actuator actuator_good(const char *needed, const char *inside)
{
	struct incise_actuator actuator;
	struct incise_error err = {0};

	if (actuator_read(&actuator, needed, inside, &err))
		fail_msg("%s: %s", inside, err.text);
	return actuator;
}

#endif
