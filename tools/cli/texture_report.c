// SPDX-License-Identifier: GPL-2.0-or-later
/* The numbers of a texture; see texture_report.h. */
#include "cli.h"
#include "texture_report.h"

void texture_print(const struct incise_texture *texture)
{
	const struct incise_texture_info *info = incise_texture_info(texture);
	const struct incise_texture_look *was = &info->recorded, *is = &info->rendered;

	printf("texture over the way in %s, of %s in %s (%.4g %s), seed %llu\n",
	       info->unit, cli_count(info->n_events, "event"),
	       cli_count(info->n_cuts, "cut"), info->length, info->unit,
	       (unsigned long long)info->seed);
	printf("  %-22s%12s%14s\n", "of unseen cuts", "recorded", "rendered");
	printf("  events per %-11s%12.3g%14.3g\n", info->unit, was->rate, is->rate);
	printf("  %-22s%12.3g%14.3g\n", "drop, median", was->drop[4], is->drop[4]);
	printf("  %-22s%12.3g%14.3g\n", "drop, 90 %", was->drop[8], is->drop[8]);
	printf("  %-22s%12.3g%14.3g\n", "rms", was->rms, is->rms);
	printf("  spectrum to %.3g cycles/%s: %.2g dB from the recorded one, %.2g dB without "
	       "texture\n",
	       info->up_to_cycles, info->unit, info->error[1], info->error[0]);
	printf("  at most %.0f %% of the model's force; from cut to cut %.2g %% (sd)\n",
	       100 * info->most, 100 * info->variation);
}

static json_t *look_json(const struct incise_texture_look *look)
{
	return json_pack("{sf sf so so}", "rate", look->rate, "rms", look->rms,
			 "drop_deciles", json_numbers(look->drop, INCISE_TEXTURE_DECILES),
			 "octaves_dB",
			 json_numbers(look->octave, INCISE_TEXTURE_OCTAVES));
}

json_t *texture_json(const struct incise_texture *texture)
{
	const struct incise_texture_info *info;

	if (!texture)
		return json_null();
	info = incise_texture_info(texture);
	return json_pack("{ss sI si si sf sf sf sf sf sf so so}", "way_unit", info->unit,
			 "seed", (json_int_t)info->seed, "cuts", info->n_cuts, "events",
			 info->n_events, "length", info->length, "most", info->most,
			 "variation", info->variation, "up_to_cycles", info->up_to_cycles,
			 "spectrum_error_dB", info->error[1], "without_texture_error_dB",
			 info->error[0], "recorded", look_json(&info->recorded),
			 "rendered", look_json(&info->rendered));
}
