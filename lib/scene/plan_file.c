// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Plans as files; see incise/plan_file.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/infile.h>
#include <incise/outfile.h>
#include <incise/plan_file.h>
#include "../base/crc32c.h"
#include "../base/vector.h"
#include "plan.h"

struct incise_plan_file {
	struct incise_fixed_plan view;
	uint32_t size;
	/* Aligned for the verifier, which reads 64-bit fields. */
	_Alignas(8) unsigned char bytes[];
};

static const struct incise_fixed_plan_header *header(const struct incise_plan_file *file)
{
	return (const struct incise_fixed_plan_header *)(const void *)file->bytes;
}

static uint32_t aligned(size_t n)
{
	return (uint32_t)((n + 7) / 8 * 8);
}

/* The last part of a path, cut to what fits. */
static void take_name(char to[64], const char *path)
{
	const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;

	memccpy(to, name, 0, 63);
}

static int check_axes(const struct incise_plan *plan, struct incise_error *err)
{
	if (!plan->integers)
		return incise_error_set(err, EINVAL,
					"%s: its arithmetic is \"double\", but a plan "
					"file is in integers; set arithmetic to "
					"\"fixed\"",
					plan->scene->path);
	for (int i = 0; i < plan->axes.n; i++)
		if (plan->axes.axis[i].info.measures_handle)
			return incise_error_set(
				err, ENOTSUP,
				"%s: it measures its handle, but a plan file takes "
				"that from the tracker; use a rig with a stepper of "
				"the kernel module",
				plan->axes.axis[i].info.name);
	return 0;
}

struct incise_plan_file *incise_plan_file_new(const struct incise_plan *plan,
					      struct incise_error *err)
{
	struct incise_plan_file *file = NULL;
	struct incise_fixed_plan_header head = {.magic = INCISE_FIXED_PLAN_MAGIC};
	struct incise_heights heights = {0};
	const struct incise_fixed *model = plan->fixed;
	int rc = check_axes(plan, err);

	if (!rc)
		rc = incise_integers_file(plan, &head.numbers, &heights, err);
	if (rc)
		goto out;
	take_name(head.name, plan->scene->path);
	strncpy(head.surface,
		plan->scene->surface_kind ? plan->scene->surface_kind : "plane",
		sizeof(head.surface) - 1);
	head.size = sizeof(head);
	if (model) {
		head.model_at = head.size;
		head.model_size = model->size;
		head.size += aligned(model->size);
	}
	if (heights.height) {
		head.heights_at = head.size;
		head.heights_size = (uint32_t)heights.frame.columns *
				    (uint32_t)heights.frame.rows * 4;
		head.size += aligned(head.heights_size);
	}
	if (plan->texture) {
		head.texture_at = head.size;
		head.size += aligned(sizeof(*plan->texture));
	}
	head.version = incise_fixed_plan_version(&head);
	file = calloc(1, sizeof(*file) + head.size);
	if (!file) {
		rc = incise_error_set(err, ENOMEM, "no memory for a plan");
		goto out;
	}
	file->size = head.size;
	if (model)
		memcpy(file->bytes + head.model_at, model->blob, model->size);
	if (heights.height)
		memcpy(file->bytes + head.heights_at, heights.height, head.heights_size);
	if (plan->texture)
		memcpy(file->bytes + head.texture_at, plan->texture,
		       sizeof(*plan->texture));
	memcpy(file->bytes, &head, sizeof(head));
	head.crc = incise_crc32c(0, file->bytes + INCISE_FIXED_PLAN_CRC_FROM,
				 head.size - INCISE_FIXED_PLAN_CRC_FROM);
	memcpy(file->bytes, &head, sizeof(head));
	rc = incise_fixed_plan_open(&file->view, file->bytes, file->size);
	if (rc)
		rc = incise_error_set(err, ERANGE,
				      "%s: the combination of its numbers exceeds "
				      "integers",
				      plan->scene->path);
out:
	incise_heights_free(&heights);
	if (!rc)
		return file;
	free(file);
	errno = -rc;
	return NULL;
}

struct incise_plan_file *incise_plan_file_load(const char *path, struct incise_error *err)
{
	static const struct incise_infile_kind kind = {
		.name = "a .plan file",
		.advice = "give a .plan file of incise compile",
		.size_max = INCISE_FIXED_PLAN_SIZE_MAX,
	};
	struct incise_plan_file *file;
	size_t size;
	char *bytes = incise_infile_read(path, &kind, &size, err);
	int rc = -ENOMEM;

	if (!bytes)
		return NULL;
	file = calloc(1, sizeof(*file) + size);
	if (file) {
		file->size = (uint32_t)size;
		memcpy(file->bytes, bytes, size);
		rc = incise_fixed_plan_open(&file->view, file->bytes, file->size);
	}
	free(bytes);
	if (!rc)
		return file;
	free(file);
	rc = incise_error_set(
		err, -rc,
		rc == -EINVAL	 ? "%s: not a .plan file, or damaged; compile the "
				   "scene again"
		: rc == -ENOTSUP ? "%s: a .plan file of another version; compile the "
				   "scene again"
				 : "%s: no memory to read it",
		path);
	errno = -rc;
	return NULL;
}

int incise_plan_file_save(const struct incise_plan_file *file, const char *path,
			  struct incise_error *err)
{
	struct incise_outfile *out = incise_outfile_open(path, err);

	if (!out)
		return -errno;
	fwrite(file->bytes, 1, file->size, incise_outfile_stream(out));
	return incise_outfile_commit(out, err);
}

static void axis_info(const struct incise_fixed_axis *axis,
		      struct incise_plan_file_info *info, int i)
{
	for (int k = 0; k < 3; k++)
		info->axis[i].direction[k] = ldexp(axis->direction[k], -30);
	info->axis[i].spring_N_mm = ldexp(1, 20) / axis->compliance;
	info->axis[i].travel_mm = ldexp(axis->travel, -16);
	info->axis[i].step_mm = ldexp(1, 16) / axis->steps_per_mm;
}

void incise_plan_file_info(const struct incise_plan_file *file,
			   struct incise_plan_file_info *info)
{
	const struct incise_fixed_plan_header *head = header(file);
	const struct incise_fixed_numbers *numbers = &head->numbers;
	const struct incise_fixed_grid_frame *grid = &numbers->grid;

	*info = (struct incise_plan_file_info){
		.crc = head->crc,
		.size = file->size,
		.bound_N = ldexp((double)numbers->bound, -32),
		.rate_hz = 1e9 / numbers->tick_ns,
		.pose_age_s = (double)numbers->pose_age_ns * 1e-9,
		.fade_s = (double)incise_fixed_plan_fade_ns(numbers) * 1e-9,
		.force_N = ldexp(numbers->force, -16),
		.slew_N_s = ldexp(numbers->slew, -16) * 1e9 / numbers->tick_ns,
		.tracker_hz = 1e9 / numbers->filter.period_ns,
		.latency_s = numbers->filter.latency_ns * 1e-9,
		.model = head->model_size > 0,
		.inserts = numbers->inserts,
		.tube = numbers->tube,
		.membrane = numbers->membrane.stiffness > 0,
		.cuts_most = numbers->inserts ? numbers->incision.cuts_most : 0,
		.n_axes = numbers->n_axes,
	};
	memcpy(info->scene, head->name, sizeof(info->scene));
	memcpy(info->surface, head->surface, sizeof(info->surface));
	for (int i = 0; i < numbers->n_axes; i++)
		axis_info(&numbers->axes[i], info, i);
	if (!head->heights_size)
		return;
	info->columns = grid->columns;
	info->rows = grid->rows;
	info->cell_mm = ldexp(1, grid->cell_shift - 16);
	info->reach_mm = ldexp(grid->reach, -16);
}

const void *incise_plan_file_bytes(const struct incise_plan_file *file, size_t *size)
{
	*size = file->size;
	return file->bytes;
}

void incise_plan_file_free(struct incise_plan_file *file)
{
	free(file);
}
