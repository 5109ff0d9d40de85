// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A plan as a file, in words and as JSON; see plan_report.h.
 */
#include <stdio.h>
#include "cli.h"
#include "plan_report.h"

static void surface_text(const struct incise_plan_file_info *info)
{
	printf("surface  %s", info->surface);
	if (info->columns)
		printf(" as %d x %d heights, %g mm apart, %.1f mm deep", info->columns,
		       info->rows, info->cell_mm, info->reach_mm);
	printf(info->membrane ? ", with a membrane\n" : "\n");
}

static void axes_text(const struct incise_plan_file_info *info)
{
	if (!info->n_axes)
		puts("actuator none");
	for (int i = 0; i < info->n_axes; i++)
		printf("actuator along (%.4g, %.4g, %.4g), spring %.4g N/mm, travel %.4g mm, "
		       "step %.4g um\n",
		       info->axis[i].direction[0], info->axis[i].direction[1],
		       info->axis[i].direction[2], info->axis[i].spring_N_mm,
		       info->axis[i].travel_mm, info->axis[i].step_mm * 1e3);
}

void plan_report_text(const struct incise_plan_file_info *info)
{
	printf("plan of %s: %g Hz, %zu bytes, CRC-32C %08x\n", info->scene, info->rate_hz,
	       info->size, (unsigned int)info->crc);
	printf("force    within %.3g mN of double, certified; at most %.4g N, changes by at "
	       "most %.4g N/s\n",
	       info->bound_N * 1e3, info->force_N, info->slew_N_s);
	printf("tracker  %.4g Hz, delay %.3g ms; without a pose younger than %.4g ms "
	       "the force ramps to zero, by %.4g ms\n",
	       info->tracker_hz, info->latency_s * 1e3, info->pose_age_s * 1e3,
	       info->fade_s * 1e3);
	surface_text(info);
	printf("tissue   %s", info->model ? "a model" : "a spring");
	if (info->inserts)
		printf("; handle and tube, up to %s%s", cli_count(info->cuts_most, "cut"),
		       info->tube ? ", the tube with a station of its own" : "");
	putchar('\n');
	axes_text(info);
}

static json_t *axes_json(const struct incise_plan_file_info *info)
{
	json_t *axes = json_array();

	for (int i = 0; i < info->n_axes; i++)
		json_array_append_new(axes,
				      json_pack("{so sf sf sf}", "direction",
						json_numbers(info->axis[i].direction, 3),
						"spring_N_mm", info->axis[i].spring_N_mm,
						"travel_mm", info->axis[i].travel_mm,
						"step_mm", info->axis[i].step_mm));
	return axes;
}

json_t *plan_report_json(const struct incise_plan_file_info *info)
{
	char crc[16];

	snprintf(crc, sizeof(crc), "%08x", (unsigned int)info->crc);
	return json_pack("{ss so so so sI ss sf sf sf sf sf sf sf sb sb sb sb si so}",
			 "kind", "plan", "scene", json_text(info->scene), "surface",
			 json_text(info->surface), "heights",
			 info->columns
				 ? json_pack("{si si sf sf}", "columns", info->columns,
					     "rows", info->rows, "cell_mm", info->cell_mm,
					     "reach_mm", info->reach_mm)
				 : json_null(),
			 "size_bytes", (json_int_t)info->size, "crc32c", crc, "bound_N",
			 info->bound_N, "rate_hz", info->rate_hz, "pose_age_ms",
			 info->pose_age_s * 1e3, "fade_ms", info->fade_s * 1e3, "force_N",
			 info->force_N, "slew_N_s", info->slew_N_s, "tracker_hz",
			 info->tracker_hz, "model", (int)info->model, "inserts",
			 (int)info->inserts, "tube", (int)info->tube, "membrane",
			 (int)info->membrane, "cuts_most", info->cuts_most, "actuators",
			 axes_json(info));
}
