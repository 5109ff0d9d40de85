// SPDX-License-Identifier: GPL-2.0-only
/*
 * Inputs: the world outside drives them through the file "inputs", by a
 * carriage, or by a script "after K edges of line L drive input M to V", so
 * that an e-stop or a fault comes at an exact moment of a motion. See
 * incise_sim.h for the words of the file "scripts".
 */
#include <linux/bitops.h>
#include <linux/fs.h>
#include <linux/ktime.h>
#include <linux/module.h>
#include <linux/seq_file.h>
#include <linux/slab.h>

#include "sim.h"

static_assert(INCISE_SIM_SCRIPTS <= 64); /* one bit each in scripts_of, fired */

bool sim_level_locked(const struct sim *sim, unsigned int line)
{
	return test_bit(line, sim->output) ? test_bit(line, sim->out)
					   : test_bit(line, sim->driven);
}

/* An edge of a line: one less to wait for. */
void sim_script_count_locked(struct sim *sim, unsigned int line, bool value)
{
	u64 waiting = sim->scripts_of[line];

	while (waiting) {
		unsigned int i = __ffs64(waiting);
		struct sim_script *script = &sim->script[i];

		waiting &= waiting - 1;
		if (!(value ? script->rising : script->falling) || --script->left)
			continue;
		sim->scripts_of[line] &= ~BIT_ULL(i);
		sim->fired |= BIT_ULL(i);
	}
}

/**
 * sim_drive_locked() - the world outside drives a line
 * @sim:	the chip, locked
 * @line:	the line; if it is an output, the level is kept for later
 * @value:	its level
 */
void sim_drive_locked(struct sim *sim, unsigned int line, bool value)
{
	if (test_bit(line, sim->driven) == value)
		return;
	__assign_bit(line, sim->driven, value);
	if (test_bit(line, sim->output))
		return;
	sim_edges_put_locked(sim, line, value, INCISE_SIM_EDGE_INPUT);
	sim_interrupt_edge_locked(sim, line, value);
	sim_script_count_locked(sim, line, value);
}

/*
 * To be called before the lock is released after any change. A script may drive
 * a line that fires the next one. Each fires once: it ends.
 */
void sim_settle_locked(struct sim *sim)
{
	while (sim->fired) {
		unsigned int i = __ffs64(sim->fired);
		struct sim_script *script = &sim->script[i];

		sim->fired &= ~BIT_ULL(i);
		script->fired_ns = ktime_get_ns();
		sim_drive_locked(sim, script->set, script->value);
	}
}

static int sim_script_word(const struct sim *sim, char *word, struct sim_script *script,
			   unsigned int *given)
{
	static const char *const keys[] = {"after", "line", "set", "value", "edge"};
	char *text = NULL;
	int i, line, ret;
	bool value;

	for (i = 0; i < ARRAY_SIZE(keys); i++)
		if (sim_text_key(word, keys[i], &text))
			break;
	if (i == ARRAY_SIZE(keys) || *given & BIT(i))
		return -EINVAL;
	*given |= BIT(i);
	switch (i) {
	case 0:
		ret = kstrtou64(text, 10, &script->left);
		return !ret && script->left ? 0 : -EINVAL;
	case 1:
		ret = sim_text_line(sim, text, &line);
		script->line = line;
		return ret;
	case 2:
		ret = sim_text_line(sim, text, &line);
		script->set = line;
		return ret;
	case 3:
		ret = sim_text_bool(text, &value);
		script->value = value;
		return ret;
	default:
		script->rising = !strcmp(text, "rising");
		script->falling = !strcmp(text, "falling");
		return script->rising || script->falling ? 0 : -EINVAL;
	}
}

/* Takes a free place, else the place of a script that has fired; EBUSY without one. */
static int sim_script_place_locked(struct sim *sim, const struct sim_script *script)
{
	int i, place = -1;

	for (i = INCISE_SIM_SCRIPTS - 1; i >= 0; i--)
		if (!sim->script[i].used ||
		    (!sim->script[i].left && (place < 0 || sim->script[place].used)))
			place = i;
	if (place < 0)
		return -EBUSY;
	sim->script[place] = *script;
	sim->scripts_of[script->line] |= BIT_ULL(place);
	return 0;
}

static int sim_script_parse(void *of, char *text)
{
	struct sim *sim = of;
	struct sim_script script = {
		.used = true,
		.rising = true,
		.falling = true,
	};
	unsigned int given = 0;
	unsigned long flags;
	char *word;
	int ret;

	while ((word = sim_text_word(&text))) {
		if (!given && !strcmp(word, "clear") && !sim_text_word(&text)) {
			raw_spin_lock_irqsave(&sim->lock, flags);
			memset(sim->script, 0, sizeof(sim->script));
			memset(sim->scripts_of, 0, sizeof(sim->scripts_of));
			raw_spin_unlock_irqrestore(&sim->lock, flags);
			return 0;
		}
		if (sim_script_word(sim, word, &script, &given))
			return -EINVAL;
	}
	if ((given & 0xf) != 0xf)
		return -EINVAL;
	raw_spin_lock_irqsave(&sim->lock, flags);
	ret = sim_script_place_locked(sim, &script);
	raw_spin_unlock_irqrestore(&sim->lock, flags);
	return ret;
}

static int sim_script_show(struct seq_file *seq, void *unused)
{
	struct sim *sim = seq->private;
	struct sim_script script;
	unsigned long flags;
	unsigned int i;

	for (i = 0; i < INCISE_SIM_SCRIPTS; i++) {
		raw_spin_lock_irqsave(&sim->lock, flags);
		script = sim->script[i];
		raw_spin_unlock_irqrestore(&sim->lock, flags);
		if (!script.used)
			continue;
		seq_printf(seq, "line=%u set=%u value=%u edge=%s", script.line,
			   script.set, script.value,
			   !script.falling  ? "rising"
			   : !script.rising ? "falling"
					    : "both");
		seq_printf(seq, " left=%llu fired_ns=%lld\n", script.left,
			   script.fired_ns);
	}
	return 0;
}

static int sim_script_open(struct inode *inode, struct file *file)
{
	return single_open(file, sim_script_show, inode->i_private);
}

static ssize_t sim_script_write(struct file *file, const char __user *from, size_t size,
				loff_t *unused)
{
	struct seq_file *seq = file->private_data;

	return sim_text_write(from, size, sim_script_parse, seq->private);
}

static const struct file_operations sim_script_fops = {
	.owner = THIS_MODULE,
	.open = sim_script_open,
	.read = seq_read,
	.write = sim_script_write,
	.llseek = seq_lseek,
	.release = single_release,
};

static int sim_inputs_show(struct seq_file *seq, void *unused)
{
	struct sim *sim = seq->private;
	unsigned int line;

	for (line = 0; line < sim->lines; line++)
		seq_printf(seq, "%u %s %d\n", line,
			   test_bit(line, sim->output) ? "out" : "in",
			   sim_level_locked(sim, line));
	return 0;
}

static int sim_inputs_open(struct inode *inode, struct file *file)
{
	return single_open(file, sim_inputs_show, inode->i_private);
}

/* All pairs are understood before the first one is applied. */
static int sim_inputs_parse(void *of, char *text)
{
	struct sim *sim = of;
	DECLARE_BITMAP(mask, INCISE_SIM_LINES_MAX) = {};
	DECLARE_BITMAP(bits, INCISE_SIM_LINES_MAX) = {};
	unsigned long flags;
	unsigned int each;
	char *word;

	while ((word = sim_text_word(&text))) {
		char *level = sim_text_word(&text);
		bool value;
		int line;

		if (!level || sim_text_line(sim, word, &line) ||
		    sim_text_bool(level, &value) || test_bit(line, mask))
			return -EINVAL;
		__set_bit(line, mask);
		__assign_bit(line, bits, value);
	}
	if (bitmap_empty(mask, INCISE_SIM_LINES_MAX))
		return -EINVAL;

	raw_spin_lock_irqsave(&sim->lock, flags);
	for_each_set_bit(each, mask, sim->lines)
		sim_drive_locked(sim, each, test_bit(each, bits));
	sim_settle_locked(sim);
	raw_spin_unlock_irqrestore(&sim->lock, flags);
	return 0;
}

static ssize_t sim_inputs_write(struct file *file, const char __user *from, size_t size,
				loff_t *unused)
{
	struct seq_file *seq = file->private_data;

	return sim_text_write(from, size, sim_inputs_parse, seq->private);
}

static const struct file_operations sim_inputs_fops = {
	.owner = THIS_MODULE,
	.open = sim_inputs_open,
	.read = seq_read,
	.write = sim_inputs_write,
	.llseek = seq_lseek,
	.release = single_release,
};

void sim_inputs_files(struct sim *sim)
{
	memset(sim->script, 0, sizeof(sim->script));
	memset(sim->scripts_of, 0, sizeof(sim->scripts_of));
	sim->fired = 0;
	debugfs_create_file("inputs", 0600, sim->dir, sim, &sim_inputs_fops);
	debugfs_create_file("scripts", 0600, sim->dir, sim, &sim_script_fops);
}
