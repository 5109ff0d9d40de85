// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What an actuator's backend counts; see stepper_counters.h.
 */
#include <stdio.h>
#include "json.h"
#include "stepper_counters.h"

json_t *stepper_counters_json(struct incise_stepper *stepper)
{
	struct incise_stepper_counter counter;
	json_t *object = json_object();

	for (int i = 0; !incise_stepper_counter(stepper, i, &counter); i++)
		json_object_set_new(object, counter.key,
				    json_integer((json_int_t)counter.value));
	return object;
}

void stepper_counters_text(struct incise_stepper *stepper)
{
	struct incise_stepper_counter counter;

	for (int i = 0; !incise_stepper_counter(stepper, i, &counter); i++)
		printf("%-10s %s: %llu\n", i ? "" : "counted", counter.text,
		       (unsigned long long)counter.value);
}

void stepper_counters_line(struct incise_stepper *stepper)
{
	struct incise_stepper_counter counter;
	const char *before = "actuator   ";

	for (int i = 0; !incise_stepper_counter(stepper, i, &counter); i++)
		if (counter.trouble && counter.value) {
			printf("%s%s: %llu", before, counter.text,
			       (unsigned long long)counter.value);
			before = ", ";
		}
	if (*before == ',')
		putchar('\n');
}
