// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * A straight line in the surface; see line.h.
 */
#include "line.h"
#include "vector.h"

/* Below this, 1/1000 in Q30, the blade lies flat on the surface, and its cut has no direction. */
#define FLAT (INCISE_FIXED_UNIT / 1000)

static int32_t size(int32_t v)
{
	return v < 0 ? -v : v;
}

void incise_fixed_line_along(int32_t along[3], const int32_t normal[3],
			     const int32_t side[3])
{
	int32_t across[3], axis[3] = {0};
	int64_t wide[3];
	int least = 0;

	incise_fx_cross(across, side, normal);
	for (int i = 0; i < 3; i++)
		wide[i] = across[i];
	if (incise_fx_unit(along, wide, 3, FLAT))
		return;
	/* Any direction in the surface: across the axis that is least along the normal. */
	for (int i = 1; i < 3; i++)
		if (size(normal[i]) < size(normal[least]))
			least = i;
	axis[least] = INCISE_FIXED_UNIT;
	incise_fx_cross(across, axis, normal);
	for (int i = 0; i < 3; i++) {
		wide[i] = across[i];
		along[i] = i ? 0 : INCISE_FIXED_UNIT;
	}
	incise_fx_unit(along, wide, 3, FLAT);
}

void incise_fixed_line_begin(struct incise_fixed_line *line, const int32_t at[3],
			     const int32_t normal[3], const int32_t side[3])
{
	*line = (struct incise_fixed_line){.there = true};
	incise_fx_copy(line->at, at);
	incise_fx_copy(line->side, side);
	incise_fixed_line_along(line->along, normal, side);
}

static int32_t along(const struct incise_fixed_line *line, const int32_t at[3])
{
	int32_t off[3];

	incise_fx_sub(off, at, line->at);
	return incise_fx_along(off, line->along);
}

void incise_fixed_line_extend(struct incise_fixed_line *line, const int32_t at[3])
{
	int32_t s = along(line, at);

	line->from = s < line->from ? s : line->from;
	line->to = s > line->to ? s : line->to;
}

bool incise_fixed_line_holds(const struct incise_fixed_line *line, const int32_t at[3])
{
	int32_t off[3], s;

	if (!line->there)
		return false;
	s = (int32_t)incise_fx_within(along(line, at), line->from, line->to);
	incise_fx_sub(off, at, line->at);
	incise_fx_add(off, off, -s, line->along);
	return incise_fx_length(off) <= INCISE_FIXED_BESIDE;
}

int32_t incise_fixed_line_advance(struct incise_fixed_line *line, const int32_t at[3],
				  const int32_t normal[3], const int32_t side[3])
{
	int64_t length = (int64_t)line->to - line->from;

	incise_fixed_line_extend(line, at);
	if (incise_fixed_line_holds(line, at))
		return incise_fx_hold32((int64_t)line->to - line->from - length);
	/* A curved skin leaves it too. The cut goes on from here. */
	incise_fixed_line_begin(line, at, normal, side);
	return INCISE_FIXED_BESIDE;
}
