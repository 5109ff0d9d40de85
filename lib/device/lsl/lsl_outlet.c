// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Outlets of the Lab Streaming Layer; see incise/outlet.h. The clock of liblsl is
 * CLOCK_MONOTONIC, in seconds.
 */
#include <errno.h>
#include <stdlib.h>
#include <incise/outlet.h>
#include "liblsl.h"

#define MEMORY_S 10 /* of a regular stream, for each reader */

struct incise_outlet {
	lsl_outlet outlet;
};

/* One for the process, as liblsl has one state in it. */
static struct liblsl lsl;

static void describe_lsl_outlet(lsl_streaminfo info,
				const struct incise_outlet_setup *setup)
{
	lsl_xml channels = lsl.lsl_append_child(lsl.lsl_get_desc(info), "channels");

	for (int i = 0; i < setup->n; i++) {
		lsl_xml one = lsl.lsl_append_child(channels, "channel");

		lsl.lsl_append_child_value(one, "label", setup->channels[i].label);
		lsl.lsl_append_child_value(one, "type", setup->channels[i].type);
		lsl.lsl_append_child_value(one, "unit", setup->channels[i].unit);
	}
}

static lsl_outlet offer(const struct incise_outlet_setup *setup)
{
	lsl_streaminfo info = lsl.lsl_create_streaminfo(
		setup->name, setup->type, setup->n ? setup->n : 1, setup->rate_hz,
		setup->n ? LSL_DOUBLE64 : LSL_STRING, setup->source_id);
	lsl_outlet outlet;

	if (!info)
		return NULL;
	describe_lsl_outlet(info, setup);
	outlet = lsl.lsl_create_outlet(info, 0, MEMORY_S);
	lsl.lsl_destroy_streaminfo(info);
	return outlet;
}

static struct incise_outlet *outlet_open(const struct incise_outlet_setup *setup,
					 struct incise_error *err)
{
	struct incise_outlet *outlet = malloc(sizeof(*outlet));

	if (!outlet)
		return INCISE_ERROR_NULL(err, ENOMEM,
					 "LSL stream %.60s: out of memory; end other "
					 "programs",
					 setup->name);
	outlet->outlet = offer(setup);
	if (outlet->outlet)
		return outlet;
	free(outlet);
	return INCISE_ERROR_NULL(
		err, EIO,
		"LSL stream %.60s: liblsl cannot offer it; see its configuration, and "
		"whether ports 16572 to 16604 are free",
		setup->name);
}

static void outlet_push(struct incise_outlet *outlet, const double *values, int64_t t_ns)
{
	lsl.lsl_push_sample_dtp(outlet->outlet, values, (double)t_ns * 1e-9, 1);
}

static void outlet_push_text(struct incise_outlet *outlet, const char *text, int64_t t_ns)
{
	lsl.lsl_push_sample_strtp(outlet->outlet, &text, (double)t_ns * 1e-9, 1);
}

static bool outlet_has_readers(struct incise_outlet *outlet)
{
	return lsl.lsl_have_consumers(outlet->outlet);
}

static void outlet_close(struct incise_outlet *outlet)
{
	if (outlet)
		lsl.lsl_destroy_outlet(outlet->outlet);
	free(outlet);
}

INCISE_API int incise_outlets_load(const char *where,
				   const struct incise_outlets **outlets,
				   struct incise_error *err);

int incise_outlets_load(const char *where, const struct incise_outlets **outlets,
			struct incise_error *err)
{
	static const struct incise_outlets functions = {
		outlet_open,	    outlet_push,  outlet_push_text,
		outlet_has_readers, outlet_close,
	};
	int rc = liblsl_open(&lsl, where, err);

	*outlets = rc ? NULL : &functions;
	return rc;
}
