// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The trackers of Polhemus that are known; see polhemus_model.h.
 */
#include <stddef.h>
#include "polhemus_model.h"

static const struct polhemus_model models[] = {
	{0x0001, false, POLHEMUS_FASTRAK, "FASTRAK"},
	{0x0002, true, POLHEMUS_FASTRAK, "FASTRAK"},
	{0x0003, true, POLHEMUS_FASTRAK, "FASTRAK"},
	{0xff11, false, POLHEMUS_LIBERTY, "LIBERTY"},
	{0xff12, true, POLHEMUS_LIBERTY, "LIBERTY"},
	{0xff20, true, POLHEMUS_LIBERTY, "LIBERTY HS"},
	{0xff21, false, POLHEMUS_LIBERTY, "LIBERTY HS"},
	{0xef11, false, POLHEMUS_PATRIOT, "PATRIOT"},
	{0xef12, true, POLHEMUS_PATRIOT, "PATRIOT"},
	{0xef20, true, POLHEMUS_PATRIOT, "PATRIOT HS"},
	{0xef21, false, POLHEMUS_PATRIOT, "PATRIOT HS"},
};

static const struct {
	const char *name;
	double hz;
	bool shared; /* among the stations */
	int64_t latency_ns;
} families[] = {
	[POLHEMUS_FASTRAK] = {"FASTRAK", 120, true, 4000000},
	[POLHEMUS_LIBERTY] = {"LIBERTY", 240, false, 3500000},
	[POLHEMUS_PATRIOT] = {"PATRIOT", 60, false, 18500000},
};

const struct polhemus_model *polhemus_model_find(uint16_t vendor, uint16_t product)
{
	if (vendor != POLHEMUS_VENDOR)
		return NULL;
	for (size_t i = 0; i < sizeof(models) / sizeof(*models); i++)
		if (models[i].product == product)
			return &models[i];
	return NULL;
}

const char *polhemus_family_name(enum polhemus_family family)
{
	return families[family].name;
}

double polhemus_family_hz(enum polhemus_family family, int stations)
{
	return families[family].shared ? families[family].hz
				       : families[family].hz * stations;
}

int64_t polhemus_family_latency_ns(enum polhemus_family family)
{
	return families[family].latency_ns;
}
