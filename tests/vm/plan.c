// SPDX-License-Identifier: GPL-2.0-or-later
/* See plan.h. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>

#include "../../lib/fixed/layout.h"
#include "../../driver/kunit/trial.h"
#include "../../lib/fixed/vector.h"
#include "plan.h"

#define MM (1 << 16)
#define ONE (1 << 16)
#define UNIT INCISE_FIXED_UNIT

/* Half a millimetre between knots, 96 of them to a side. */
#define CELL_SHIFT 15
#define KNOTS 96

static int32_t height(int column, int row)
{
	/* Two slopes, of a tenth: what is not a plane, and has an edge. */
	return (column < KNOTS / 2 ? column : KNOTS - column) * (MM / 20) +
	       row * (MM / 40);
}

static void *model_of(const char *path, uint32_t *size)
{
	FILE *file = fopen(path, "r");
	void *bytes = NULL;
	long n = 0;

	if (file && !fseek(file, 0, SEEK_END)) {
		n = ftell(file);
		rewind(file);
		bytes = malloc((size_t)n + 8);
	}
	if (bytes && fread(bytes, 1, (size_t)n, file) != (size_t)n) {
		free(bytes);
		bytes = NULL;
	}
	if (file)
		fclose(file);
	*size = (uint32_t)n;
	return bytes;
}

static void scalpel(struct incise_fixed_numbers *numbers,
		    const struct plan_recipe *recipe)
{
	/* 120 Hz. */
	numbers->filter = (struct incise_fixed_filter){
		.alpha = UNIT / 2,
		.beta = 20 * ONE,
		.gamma = 200 << 12,
		.period_ns = 8333333,
		.latency_ns = 4000000,
		.gap_ns = 40000000,
		.ahead_ns = 20000000,
	};
	numbers->tip[2] = -50 * MM;
	numbers->axis[2] = UNIT;
	numbers->side[0] = UNIT;
	numbers->handle = 120 * MM;
	numbers->inserts = recipe->inserts;
	numbers->tube = recipe->tube;
	numbers->up[2] = UNIT;
	numbers->leave = MM / 4;
	numbers->average_ticks = recipe->plain ? 1 : 16;
}

static void surface(struct incise_fixed_numbers *numbers,
		    enum incise_fixed_shape_kind kind)
{
	struct incise_fixed_grid_frame *grid = &numbers->grid;

	numbers->shape.kind = (int32_t)kind;
	if (kind == INCISE_FIXED_PLANE)
		numbers->shape.normal[2] = UNIT;
	if (kind == INCISE_FIXED_CAPSULE) {
		numbers->shape.point[0] = -30 * MM;
		numbers->shape.point[2] = -20 * MM;
		numbers->shape.normal[0] = UNIT;
		numbers->shape.length = 60 * MM;
		numbers->shape.radius = 20 * MM;
	}
	if (kind != INCISE_FIXED_GRID)
		return;
	grid->origin[0] = grid->origin[1] = -KNOTS / 4 * MM;
	grid->origin[2] = -MM;
	for (int i = 0; i < 3; i++)
		grid->axis[i][i] = UNIT;
	grid->cell_shift = CELL_SHIFT;
	grid->columns = grid->rows = KNOTS;
	grid->reach = 30 * MM;
}

static void tissue(struct incise_fixed_numbers *numbers, const struct plan_recipe *recipe)
{
	numbers->reaction = ONE / 2;
	if (recipe->plain)
		return;
	if (recipe->model) {
		numbers->gain = ONE;
		numbers->support = 8 * MM;
		numbers->beyond = ONE / 2;
		numbers->unloading = 2 * ONE;
		numbers->friction = ONE / 10;
	}
	numbers->plane = ONE / 4;
	numbers->damping = 1 << 18;
	numbers->insertion = ONE / 5;
	numbers->aligned = ONE / 8;
	numbers->spread = ONE / 10;
	if (recipe->inserts)
		numbers->incision = (struct incise_fixed_incision_setup){
			.cuts_most = 16,
			.cut_from = MM / 2,
			.stretch = MM / 4,
			.handle_width = 6 * MM,
			.handle_thickness = 2 * MM,
			.tube = 5 * MM,
		};
	if (!recipe->membrane)
		return;
	numbers->membrane.point[2] = -2 * MM;
	numbers->membrane.normal[2] = UNIT;
	numbers->membrane.radius = 10 * MM;
	numbers->membrane.thickness = MM / 2;
	numbers->membrane.stiffness = ONE;
	numbers->membrane.back_wall = MM;
}

static void limits(struct incise_fixed_numbers *numbers, const struct plan_recipe *recipe)
{
	numbers->pose_age_ns = 50000000;
	numbers->tick_ns = recipe->tick_ns;
	numbers->n_axes = recipe->axes;
	numbers->small = ONE / 20;
	numbers->ramp_ns = 50000000;
	numbers->fade_ns = 30000000;
	numbers->force = 4 * ONE;
	/* 100 N/s */
	numbers->slew = (int32_t)((int64_t)100 * ONE * recipe->tick_ns / 1000000000);
	for (int i = 0; i < recipe->axes; i++) {
		struct incise_fixed_axis *axis = &numbers->axes[i];

		axis->direction[(i + 2) % 3] = UNIT;
		axis->dual[(i + 2) % 3] = 1 << 24;
		axis->compliance = 1 << 19; /* 2 N/mm */
		axis->steps_per_mm = 50 * ONE;
		axis->origin = -15 * MM;
		axis->travel = 30 * MM;
		axis->rest = 15 * MM;
	}
}

void *plan_make(const struct plan_recipe *recipe, uint32_t *size)
{
	struct incise_fixed_plan_header *head;
	uint32_t model_size = 0, heights = 0, texture = 0;
	uint64_t seed = 1;
	void *model = NULL;

	if (recipe->model)
		model = model_of(recipe->model, &model_size);
	if (recipe->model && !model)
		return NULL;
	if (recipe->surface == INCISE_FIXED_GRID)
		heights = KNOTS * KNOTS * sizeof(int32_t);
	if (recipe->model && recipe->texture)
		texture = sizeof(struct incise_fixed_texture);
	*size = sizeof(*head) + (model_size + 7) / 8 * 8 + heights + texture;
	head = calloc(1, *size);
	if (!head) {
		free(model);
		return NULL;
	}
	memcpy(head->magic, INCISE_FIXED_PLAN_MAGIC, sizeof(head->magic));
	head->size = *size;
	snprintf(head->name, sizeof(head->name), "%s", recipe->name);
	if (model) {
		head->model_at = sizeof(*head);
		head->model_size = model_size;
		memcpy(head + 1, model, model_size);
		free(model);
	}
	if (heights) {
		int32_t *to =
			(int32_t *)(void *)((char *)head + *size - texture - heights);

		head->heights_at = *size - texture - heights;
		head->heights_size = heights;
		for (int i = 0; i < KNOTS * KNOTS; i++)
			to[i] = height(i % KNOTS, i / KNOTS);
	}
	if (texture) {
		head->texture_at = *size - texture;
		incise_fx_trial_texture(&seed, INCISE_TEXTURE_ONE / 2,
					(void *)((char *)head + head->texture_at));
	}
	scalpel(&head->numbers, recipe);
	surface(&head->numbers, recipe->surface);
	tissue(&head->numbers, recipe);
	limits(&head->numbers, recipe);
	head->version = incise_fixed_plan_version(head);
	head->crc = incise_fx_crc((uint8_t *)head + INCISE_FIXED_PLAN_CRC_FROM,
				  *size - INCISE_FIXED_PLAN_CRC_FROM);
	return head;
}

int plan_load(const struct bench *bench, const void *file, uint32_t size, uint32_t motors)
{
	struct incise_stepper_plan plan = {
		.motors = motors,
		.data = (uintptr_t)file,
		.size = size,
	};

	return ioctl(bench->fd, INCISE_STEPPER_LOAD_PLAN, &plan) ? -errno : 0;
}

int plan_unload(const struct bench *bench, uint32_t motors)
{
	return plan_load(bench, NULL, 0, motors);
}

struct incise_stepper_config plan_config(const struct bench *bench, unsigned int motor,
					 uint32_t tick_ns, uint64_t deadman_ns)
{
	return (struct incise_stepper_config){
		.motor = motor,
		.tick_ns = tick_ns,
		.velocity = bench->info.rate_max < 5000 ? bench->info.rate_max : 5000,
		.acceleration = 200000,
		.late_max = 1000,
		.position_min = 0,
		.position_max = 1500,
		.safe_position = 750,
		.deadman_ns = deadman_ns,
		.high_ns = bench->info.pulse_ns,
		.low_ns = bench->info.pulse_ns,
	};
}

uint32_t plan_pose(const struct bench *bench, unsigned int slot,
		   const struct incise_fixed_pose *pose)
{
	volatile struct incise_stepper_setpoint *to = &bench->setpoint[slot];
	uint32_t seq = to->seq;

	to->seq = seq + 1;
	__atomic_thread_fence(__ATOMIC_SEQ_CST);
	to->mode = INCISE_STEPPER_MODE_POSE;
	to->target = 0;
	to->t_ns = pose->t_ns;
	for (int i = 0; i < 3; i++)
		to->pose.position[i] = pose->position[i];
	for (int i = 0; i < 4; i++)
		to->pose.quaternion[i] = pose->quaternion[i];
	to->pose.tool = slot == INCISE_STEPPER_SLOT_TUBE ? 0 : pose->tool;
	to->pose.reserved = 0;
	__atomic_thread_fence(__ATOMIC_SEQ_CST);
	to->seq = seq + 2;
	return seq + 2;
}

struct incise_stepper_plan_status plan_look(const struct bench *bench)
{
	const volatile struct incise_stepper_plan_status *page =
		(const volatile void *)&bench->status[INCISE_STEPPER_SLOT_PLAN];
	struct incise_stepper_plan_status copy;
	uint32_t seq;

	do {
		seq = page->seq;
		__atomic_thread_fence(__ATOMIC_SEQ_CST);
		copy = *page;
		__atomic_thread_fence(__ATOMIC_SEQ_CST);
	} while (seq & 1 || seq != page->seq);
	return copy;
}

/* ±@most. */
static int32_t noise(struct plan_hand *hand, int32_t most)
{
	return (int32_t)(incise_fx_trial_next(&hand->draw) >> 33) % (most + 1) - most / 2;
}

/* 0 … @most and back, once in @period_ns. */
static int32_t swing(int64_t t_ns, int64_t period_ns, int32_t most)
{
	int64_t at = t_ns % period_ns;

	at = at < period_ns / 2 ? at : period_ns - at;
	return (int32_t)(at * most / (period_ns / 2));
}

struct incise_fixed_pose plan_hand_at(struct plan_hand *hand, int64_t t_ns)
{
	int64_t t = t_ns - hand->start_ns;
	struct incise_fixed_pose pose = {.t_ns = t_ns, .quaternion = {UNIT}};

	/* Out of the tissue first; strokes to and fro across it, each in another direction. */
	pose.position[0] = swing(t, 1700000000, 12 * MM) - 6 * MM + noise(hand, MM / 50);
	pose.position[1] = swing(t, 5300000000, 10 * MM) - 5 * MM + noise(hand, MM / 50);
	pose.position[2] = 53 * MM - swing(t, 1300000000, 7 * MM) + noise(hand, MM / 50);
	if (hand->tube)
		pose.position[2] += 25 * MM - 50 * MM;
	/* A little about two axes; not of length 1 to the bit, as of a tracker. */
	pose.quaternion[1] = noise(hand, UNIT / 100);
	pose.quaternion[2] = noise(hand, UNIT / 100);
	return pose;
}

static uint32_t digest_of(uint32_t crc, const struct incise_fixed_tick *tick, int n_axes)
{
	uint32_t words[3 + INCISE_FIXED_AXES_MAX + 1];
	int n = 0;

	for (int i = 0; i < 3; i++)
		words[n++] = incise_fx_le32((uint32_t)tick->command[i]);
	for (int i = 0; i < n_axes; i++)
		words[n++] = incise_fx_le32((uint32_t)tick->target[i]);
	words[n++] = incise_fx_le32(tick->flags);
	for (int i = 0; i < n * 4; i++) {
		crc ^= ((const uint8_t *)words)[i];
		for (int bit = 0; bit < 8; bit++)
			crc = (crc >> 1) ^ (crc & 1 ? 0x82f63b78u : 0);
	}
	return crc;
}

uint32_t plan_replay(const void *file, uint32_t size, const struct plan_log *log,
		     struct incise_fixed_tick *last)
{
	struct incise_fixed_state *state = malloc(sizeof(*state));
	struct incise_fixed_plan plan;
	uint32_t crc = ~0u, taken = 0, differ = 0;
	uint64_t tick = 0;

	if (!state || incise_fixed_plan_open(&plan, file, size)) {
		free(state);
		return UINT32_MAX;
	}
	incise_fixed_plan_begin(&plan, state);
	for (uint32_t i = 0; i < log->n_seen; i++) {
		while (tick < log->seen[i].ticks) {
			int64_t t_ns =
				log->first_ns + (int64_t)tick * plan.numbers.tick_ns;

			tick++;
			while (taken < log->n_taken && log->taken[taken].tick == tick)
				incise_fixed_plan_pose(&plan, state,
						       &log->taken[taken++].pose, t_ns);
			incise_fixed_plan_tick(&plan, state, t_ns, last);
			crc = digest_of(crc, last, plan.numbers.n_axes);
		}
		differ += ~crc != log->seen[i].digest;
	}
	free(state);
	return differ + (taken < log->n_taken);
}

#define TRACING "/sys/kernel/tracing/"

static void trace_put(const char *name, const char *text)
{
	FILE *file = fopen(name, "w");

	if (!file)
		return;
	fputs(text, file);
	fclose(file);
}

void plan_trace_begin(void)
{
	trace_put(TRACING "buffer_size_kb", "4096");
	trace_put(TRACING "trace", "\n");
	trace_put(TRACING "events/incise_stepper/incise_stepper_plan/enable", "1");
}

static int by_size(const void *a, const void *b)
{
	uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;

	return x < y ? -1 : x > y;
}

uint32_t plan_trace_end(uint32_t *cost_ns, uint32_t *late_ns, uint32_t capacity)
{
	FILE *file;
	char line[512];
	uint32_t n = 0;

	trace_put(TRACING "events/incise_stepper/incise_stepper_plan/enable", "0");
	file = fopen(TRACING "trace", "r");
	while (file && n < capacity && fgets(line, sizeof(line), file)) {
		const char *at = strstr(line, "due_ns=");
		long long due, actual;

		if (at && sscanf(at, "due_ns=%lld actual_ns=%lld cost_ns=%u", &due,
				 &actual, &cost_ns[n]) == 3)
			late_ns[n++] = (uint32_t)(actual - due);
	}
	if (file)
		fclose(file);
	trace_put(TRACING "trace", "\n");
	qsort(cost_ns, n, sizeof(*cost_ns), by_size);
	qsort(late_ns, n, sizeof(*late_ns), by_size);
	return n;
}

int64_t plan_table(const struct bench *bench, const char *file, const char *row,
		   int column)
{
	char path[160], line[256], *word;
	int64_t number = -1;
	FILE *table;

	snprintf(path, sizeof(path), "/sys/kernel/debug/incise_stepper/%s/%s",
		 strrchr(bench->cdev, '/') + 1, file);
	table = fopen(path, "r");
	while (table && number < 0 && fgets(line, sizeof(line), table)) {
		word = strtok(line, " \n");
		if (!word || strcmp(word, row))
			continue;
		for (int i = 0; word && i <= column; i++)
			word = strtok(NULL, " \n");
		number = word ? strtoll(word, NULL, 10) : -1;
	}
	if (table)
		fclose(table);
	return number;
}
