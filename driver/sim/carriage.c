// SPDX-License-Identifier: GPL-2.0-only
/*
 * Mechanics: counts the steps that a motor's driver would see and drives the
 * limit and home inputs from the position, inside the edge that moved it. So a
 * test can demand that a motor stands within one step of its limit. Positions
 * in steps; see incise_sim.h for the words of the file "carriage".
 */
#include <linux/fs.h>
#include <linux/limits.h>
#include <linux/module.h>
#include <linux/seq_file.h>
#include <linux/slab.h>

#include "sim.h"

static const char *const sim_carriage_names[SIM_CARRIAGE_LINES] = {
	[SIM_STEP] = "step", [SIM_DIR] = "dir", [SIM_ENABLE] = "enable",
	[SIM_MIN] = "min",   [SIM_MAX] = "max", [SIM_HOME] = "home",
};

static bool sim_carriage_inverts(const struct sim_carriage *carriage,
				 enum sim_carriage_line which)
{
	return carriage->inverted & BIT(which);
}

/* Is the line active? An absent line is (nothing disables the motor). */
static bool sim_carriage_active(const struct sim *sim,
				const struct sim_carriage *carriage,
				enum sim_carriage_line which)
{
	int line = carriage->line[which];

	return line == SIM_NO_LINE ||
	       sim_level_locked(sim, line) != sim_carriage_inverts(carriage, which);
}

static void sim_carriage_drive(struct sim *sim, const struct sim_carriage *carriage,
			       enum sim_carriage_line which, bool active)
{
	int line = carriage->line[which];

	if (line != SIM_NO_LINE)
		sim_drive_locked(sim, line,
				 active != sim_carriage_inverts(carriage, which));
}

/* Inputs are a function of the position and of nothing else. */
static void sim_carriage_sense(struct sim *sim, const struct sim_carriage *carriage)
{
	s64 position = carriage->position;

	sim_carriage_drive(sim, carriage, SIM_MIN, position <= carriage->min_at);
	sim_carriage_drive(sim, carriage, SIM_MAX, position >= carriage->max_at);
	sim_carriage_drive(sim, carriage, SIM_HOME,
			   position >= carriage->home_from &&
				   position <= carriage->home_to);
}

/* An edge of an output: does a carriage step by it? */
void sim_carriage_step_locked(struct sim *sim, unsigned int line, bool value)
{
	unsigned long which = sim->steps_of[line];
	unsigned int i;

	for_each_set_bit(i, &which, INCISE_SIM_CARRIAGES) {
		struct sim_carriage *carriage = &sim->carriage[i];

		if (value == sim_carriage_inverts(carriage, SIM_STEP))
			continue;
		if (carriage->ignore || !sim_carriage_active(sim, carriage, SIM_ENABLE)) {
			carriage->ignore -= !!carriage->ignore;
			carriage->ignored++;
			continue;
		}
		if (sim_carriage_active(sim, carriage, SIM_DIR)) {
			carriage->up++;
			carriage->position++;
			carriage->highest = max(carriage->highest, carriage->position);
		} else {
			carriage->down++;
			carriage->position--;
			carriage->lowest = min(carriage->lowest, carriage->position);
		}
		sim_carriage_sense(sim, carriage);
	}
}

static int sim_carriage_inverted(char *text, unsigned int *inverted)
{
	char *name;

	*inverted = 0;
	if (!strcmp(text, "0"))
		return 0;
	while ((name = strsep(&text, ","))) {
		int which = match_string(sim_carriage_names, SIM_CARRIAGE_LINES, name);

		if (which < 0)
			return -EINVAL;
		*inverted |= BIT(which);
	}
	return 0;
}

/* "FROM..TO" */
static int sim_carriage_range(char *text, s64 *from, s64 *to)
{
	char *dots = strstr(text, "..");

	if (!dots)
		return -EINVAL;
	*dots = '\0';
	if (kstrtos64(text, 10, from) || kstrtos64(dots + 2, 10, to))
		return -EINVAL;
	return *from <= *to ? 0 : -EINVAL;
}

static int sim_carriage_word(const struct sim *sim, char *word,
			     struct sim_carriage *carriage, unsigned int *number)
{
	char *value;
	int i;

	if (sim_text_key(word, "number", &value))
		return kstrtouint(value, 10, number);
	if (sim_text_key(word, "ignore", &value))
		return kstrtou64(value, 10, &carriage->ignore);
	if (sim_text_key(word, "min_at", &value))
		return kstrtos64(value, 10, &carriage->min_at);
	if (sim_text_key(word, "max_at", &value))
		return kstrtos64(value, 10, &carriage->max_at);
	if (sim_text_key(word, "position", &value))
		return kstrtos64(value, 10, &carriage->position);
	if (sim_text_key(word, "home_at", &value))
		return sim_carriage_range(value, &carriage->home_from,
					  &carriage->home_to);
	if (sim_text_key(word, "inverted", &value))
		return sim_carriage_inverted(value, &carriage->inverted);
	for (i = 0; i < SIM_CARRIAGE_LINES; i++)
		if (sim_text_key(word, sim_carriage_names[i], &value))
			return sim_text_line(sim, value, &carriage->line[i]);
	return -EINVAL;
}

/*
 * Positions stay far from where counting would overflow; two roles cannot
 * share a line, nor can an input that two carriages drive.
 */
static bool sim_carriage_valid(const struct sim_carriage *carriage)
{
	const s64 far = S64_MAX / 4;
	int i, j;

	if (carriage->line[SIM_STEP] == SIM_NO_LINE ||
	    carriage->line[SIM_DIR] == SIM_NO_LINE || carriage->position > far ||
	    carriage->position < -far)
		return false;
	for (i = 0; i < SIM_CARRIAGE_LINES; i++)
		for (j = 0; j < i; j++)
			if (carriage->line[i] != SIM_NO_LINE &&
			    carriage->line[i] == carriage->line[j])
				return false;
	return true;
}

/* Swaps in a carriage (or removes it), and sets the inputs as its position asks. */
static void sim_carriage_place(struct sim *sim, unsigned int number,
			       const struct sim_carriage *carriage)
{
	struct sim_carriage *place = &sim->carriage[number];
	unsigned long flags;

	raw_spin_lock_irqsave(&sim->lock, flags);
	if (place->used)
		sim->steps_of[place->line[SIM_STEP]] &= ~BIT(number);
	*place = *carriage;
	if (place->used) {
		sim->steps_of[place->line[SIM_STEP]] |= BIT(number);
		sim_carriage_sense(sim, place);
		sim_settle_locked(sim);
	}
	raw_spin_unlock_irqrestore(&sim->lock, flags);
}

static int sim_carriage_parse(void *of, char *text)
{
	struct sim *sim = of;
	const struct sim_carriage none = {};
	struct sim_carriage carriage = {
		.used = true,
		.min_at = S64_MIN,
		.max_at = S64_MAX,
		.home_from = S64_MAX,
		.home_to = S64_MIN,
	};
	unsigned int number = INCISE_SIM_CARRIAGES;
	bool off = false, more = false;
	char *word;
	int i;

	for (i = 0; i < SIM_CARRIAGE_LINES; i++)
		carriage.line[i] = SIM_NO_LINE;
	while ((word = sim_text_word(&text))) {
		if (!strcmp(word, "off")) {
			off = true;
			continue;
		}
		more |= strncmp(word, "number=", 7) != 0;
		if (sim_carriage_word(sim, word, &carriage, &number))
			return -EINVAL;
		/* INCISE_SIM_CARRIAGES says "not given": not to be written. */
		if (!strncmp(word, "number=", 7) && number >= INCISE_SIM_CARRIAGES)
			return -EINVAL;
	}
	if (off && more)
		return -EINVAL;
	if (off) {
		for (i = 0; i < INCISE_SIM_CARRIAGES; i++)
			if (number == INCISE_SIM_CARRIAGES || i == number)
				sim_carriage_place(sim, i, &none);
		return 0;
	}
	if (!sim_carriage_valid(&carriage))
		return -EINVAL;
	carriage.lowest = carriage.position;
	carriage.highest = carriage.position;
	sim_carriage_place(sim, number % INCISE_SIM_CARRIAGES, &carriage);
	return 0;
}

static void sim_carriage_show_one(struct seq_file *seq, unsigned int number,
				  const struct sim_carriage *carriage)
{
	const char *comma = "";
	int i;

	seq_printf(seq, "number=%u", number);
	for (i = 0; i < SIM_CARRIAGE_LINES; i++)
		if (carriage->line[i] != SIM_NO_LINE)
			seq_printf(seq, " %s=%d", sim_carriage_names[i],
				   carriage->line[i]);
	seq_printf(seq, " min_at=%lld max_at=%lld", carriage->min_at, carriage->max_at);
	if (carriage->home_from <= carriage->home_to)
		seq_printf(seq, " home_at=%lld..%lld", carriage->home_from,
			   carriage->home_to);
	seq_printf(seq, " position=%lld inverted=%s", carriage->position,
		   carriage->inverted ? "" : "0");
	for (i = 0; i < SIM_CARRIAGE_LINES; i++)
		if (sim_carriage_inverts(carriage, i)) {
			seq_printf(seq, "%s%s", comma, sim_carriage_names[i]);
			comma = ",";
		}
	seq_printf(seq, " steps=%llu up=%llu down=%llu ignored=%llu",
		   carriage->up + carriage->down, carriage->up, carriage->down,
		   carriage->ignored);
	seq_printf(seq, " lowest=%lld highest=%lld\n", carriage->lowest,
		   carriage->highest);
}

static int sim_carriage_show(struct seq_file *seq, void *unused)
{
	struct sim *sim = seq->private;
	struct sim_carriage carriage;
	unsigned long flags;
	unsigned int i;

	for (i = 0; i < INCISE_SIM_CARRIAGES; i++) {
		raw_spin_lock_irqsave(&sim->lock, flags);
		carriage = sim->carriage[i];
		raw_spin_unlock_irqrestore(&sim->lock, flags);
		if (carriage.used)
			sim_carriage_show_one(seq, i, &carriage);
	}
	return 0;
}

static int sim_carriage_open(struct inode *inode, struct file *file)
{
	return single_open(file, sim_carriage_show, inode->i_private);
}

static ssize_t sim_carriage_write(struct file *file, const char __user *from, size_t size,
				  loff_t *unused)
{
	struct seq_file *seq = file->private_data;

	return sim_text_write(from, size, sim_carriage_parse, seq->private);
}

static const struct file_operations sim_carriage_fops = {
	.owner = THIS_MODULE,
	.open = sim_carriage_open,
	.read = seq_read,
	.write = sim_carriage_write,
	.llseek = seq_lseek,
	.release = single_release,
};

void sim_carriage_files(struct sim *sim)
{
	memset(sim->carriage, 0, sizeof(sim->carriage));
	memset(sim->steps_of, 0, sizeof(sim->steps_of));
	debugfs_create_file("carriage", 0600, sim->dir, sim, &sim_carriage_fops);
}
