// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Haptic devices in front of their backends; see incise/haptic.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../base/vector.h"
#include "backends.h"
#include "haptic_page.h"
#include "../sim/sim.h"

void incise_haptic_set_info(struct incise_haptic *haptic,
			    const struct incise_haptic_setup *setup)
{
	struct incise_haptic_info *info = &haptic->info;
	const struct {
		double of_rig, *to;
	} rows[] = {
		{setup->mass_kg, &info->mass_kg},
		{setup->damping_N_s_mm, &info->damping_N_s_mm},
		{setup->coulomb_N, &info->coulomb_N},
		{setup->peak_N, &info->peak_N},
		{setup->continuous_N, &info->continuous_N},
		{setup->rate_hz, &info->rate_hz},
	};

	if (haptic->ops->info) {
		memset(info, 0, sizeof(*info));
		haptic->ops->info(haptic, info);
	}
	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++)
		if (rows[i].of_rig > 0)
			*rows[i].to = rows[i].of_rig;
	if (v3_length(setup->low_mm) > 0 || v3_length(setup->high_mm) > 0) {
		v3_copy(info->low_mm, setup->low_mm);
		v3_copy(info->high_mm, setup->high_mm);
	}
	if (setup->latency_ms > 0)
		info->latency_ns = llround(setup->latency_ms * 1e6);
	if (setup->force_latency_ms > 0)
		info->force_latency_ns = llround(setup->force_latency_ms * 1e6);
}

struct incise_haptic *incise_haptic_open(const char *device, const char *where,
					 const struct incise_haptic_setup *setup,
					 struct incise_clock *clock,
					 struct incise_error *err)
{
	size_t length = strcspn(device, ":");
	struct incise_backend_request request = {
		.arguments = device[length] ? device + length + 1 : "",
		.where = where,
		.clock = clock,
		.haptic = setup,
	};
	struct incise_loaded loaded = {0};
	struct incise_haptic *haptic;
	char name[32];
	int rc;

	snprintf(name, sizeof(name), "%.*s", (int)length, device);
	rc = strcmp(name, "sim")
		     ? incise_backend_find(&loaded, "haptic", name, where, err)
		     : 0;
	if (rc) {
		errno = -rc;
		return NULL;
	}
	haptic = loaded.backend ? loaded.backend->open(&request, err)
				: incise_sim_haptic_new(&request, err);
	if (!haptic) {
		rc = errno;
		incise_backend_unload(&loaded);
		errno = rc ? rc : EIO;
		return NULL;
	}
	haptic->module = loaded.handle;
	incise_haptic_set_info(haptic, setup);
	return haptic;
}

void incise_haptic_close(struct incise_haptic *haptic)
{
	struct incise_loaded loaded = {0};

	if (!haptic)
		return;
	loaded.handle = haptic->module;
	haptic->ops->close(haptic);
	incise_backend_unload(&loaded);
}

int incise_haptic_read(struct incise_haptic *haptic, struct incise_haptic_sample *samples,
		       int n)
{
	return haptic->error ? haptic->error : haptic->ops->read(haptic, samples, n);
}

int incise_haptic_push(struct incise_haptic *haptic, const double force_N[3],
		       const double torque_N_mm[3])
{
	const double none[3] = {0};
	const double *torque = torque_N_mm ? torque_N_mm : none;

	if (!v3_finite(force_N) || !v3_finite(torque))
		return -EDOM;
	return haptic->error ? haptic->error : haptic->ops->push(haptic, force_N, torque);
}

void incise_haptic_info(const struct incise_haptic *haptic,
			struct incise_haptic_info *info)
{
	*info = haptic->info;
}

uint64_t incise_haptic_lost(const struct incise_haptic *haptic)
{
	return haptic->ops->lost ? haptic->ops->lost(haptic) : haptic->lost;
}

int64_t incise_haptic_ages_add(struct incise_haptic_ages *ages, int64_t t_ns,
			       int64_t now_ns)
{
	double age_ms = (double)(now_ns - t_ns) * 1e-6, step_ms = age_ms - ages->mean_ms;
	double sum2_ms2 = ages->jitter_ms * ages->jitter_ms * (double)ages->ticks;

	ages->ticks++;
	ages->mean_ms += step_ms / (double)ages->ticks;
	ages->most_ms = fmax(ages->most_ms, age_ms);
	sum2_ms2 += step_ms * (age_ms - ages->mean_ms);
	ages->jitter_ms = sqrt(sum2_ms2 / (double)ages->ticks);
	return now_ns - t_ns;
}

int incise_haptic_cause(struct incise_haptic *haptic, char *text, size_t size)
{
	return haptic->ops->cause ? haptic->ops->cause(haptic, text, size)
				  : snprintf(text, size, "%s", haptic->cause);
}
