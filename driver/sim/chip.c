// SPDX-License-Identifier: GPL-2.0-only
/*
 * The lines: what gpiolib calls, and the file "inputs" by which a test drives
 * them. A line has two levels, the one that the chip puts out and the one that
 * the world outside drives; its direction says which one counts:
 *
 *	set() --------> out ----\  output
 *	                         >---------> level
 *	inputs, --> driven -----/  input
 *	carriage, script
 */
#include <linux/fs.h>
#include <linux/module.h>
#include <linux/seq_file.h>
#include <linux/slab.h>

#include "../compat.h"
#include "sim.h"

bool sim_level_locked(const struct sim *sim, unsigned int line)
{
	return test_bit(line, sim->output) ? test_bit(line, sim->out)
					   : test_bit(line, sim->driven);
}

/* The level has changed: tell everyone, in the order of cause and effect. */
static void sim_changed_locked(struct sim *sim, unsigned int line, bool value,
			       unsigned int flags)
{
	bool output = test_bit(line, sim->output);

	sim_edges_put_locked(sim, line, value,
			     flags | (output ? 0 : INCISE_SIM_EDGE_INPUT));
	if (output)
		sim_carriage_step_locked(sim, line, value);
	else
		sim_interrupt_edge_locked(sim, line, value);
	sim_script_count_locked(sim, line, value);
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
	if (!test_bit(line, sim->output))
		sim_changed_locked(sim, line, value, 0);
}

/* To be called before the lock is released after any change. */
void sim_settle_locked(struct sim *sim)
{
	if (sim->fired)
		sim_script_fire_locked(sim);
}

static void sim_put_out_locked(struct sim *sim, unsigned int line, bool value)
{
	if (test_bit(line, sim->out) == value) {
		sim->ring.repeats++;
		return;
	}
	__assign_bit(line, sim->out, value);
	if (test_bit(line, sim->output))
		sim_changed_locked(sim, line, value, 0);
}

static int sim_set(struct gpio_chip *chip, unsigned int line, int value)
{
	struct sim *sim = gpiochip_get_data(chip);
	unsigned long flags;

	raw_spin_lock_irqsave(&sim->lock, flags);
	sim_put_out_locked(sim, line, value);
	sim_settle_locked(sim);
	raw_spin_unlock_irqrestore(&sim->lock, flags);
	return 0;
}

COMPAT_GPIO_SET(sim_set)

static int sim_get(struct gpio_chip *chip, unsigned int line)
{
	/* One word is read at a time: no need for the lock. */
	return sim_level_locked(gpiochip_get_data(chip), line);
}

static int sim_get_direction(struct gpio_chip *chip, unsigned int line)
{
	struct sim *sim = gpiochip_get_data(chip);

	return test_bit(line, sim->output) ? GPIO_LINE_DIRECTION_OUT
					   : GPIO_LINE_DIRECTION_IN;
}

static int sim_direction_input(struct gpio_chip *chip, unsigned int line)
{
	struct sim *sim = gpiochip_get_data(chip);
	unsigned long flags;

	raw_spin_lock_irqsave(&sim->lock, flags);
	if (test_and_clear_bit(line, sim->output))
		sim_edges_put_locked(sim, line, test_bit(line, sim->driven),
				     INCISE_SIM_EDGE_INPUT | INCISE_SIM_EDGE_CONFIGURED);
	raw_spin_unlock_irqrestore(&sim->lock, flags);
	return 0;
}

static int sim_direction_output(struct gpio_chip *chip, unsigned int line, int value)
{
	struct sim *sim = gpiochip_get_data(chip);
	unsigned long flags;

	raw_spin_lock_irqsave(&sim->lock, flags);
	if (test_bit(line, sim->output)) {
		sim_put_out_locked(sim, line, value);
	} else {
		bool before = test_bit(line, sim->driven);

		__assign_bit(line, sim->out, value);
		__set_bit(line, sim->output);
		/* A motor's driver sees an edge only where there is one. */
		if (before != !!value)
			sim_changed_locked(sim, line, value, INCISE_SIM_EDGE_CONFIGURED);
		else
			sim_edges_put_locked(sim, line, value,
					     INCISE_SIM_EDGE_CONFIGURED);
	}
	sim_settle_locked(sim);
	raw_spin_unlock_irqrestore(&sim->lock, flags);
	return 0;
}

int sim_chip_add(struct sim *sim, struct device *parent)
{
	struct gpio_chip *chip = &sim->chip;

	/* After an unbind it starts as new, but for the ring: a log outlives it. */
	bitmap_zero(sim->output, INCISE_SIM_LINES_MAX);
	bitmap_zero(sim->out, INCISE_SIM_LINES_MAX);
	bitmap_zero(sim->driven, INCISE_SIM_LINES_MAX);
	memset(chip, 0, sizeof(*chip));
	chip->label = INCISE_SIM_LABEL;
	chip->parent = parent;
	chip->owner = THIS_MODULE;
	chip->base = -1;
	chip->ngpio = sim->lines;
	chip->can_sleep = false;
	chip->get_direction = sim_get_direction;
	chip->direction_input = sim_direction_input;
	chip->direction_output = sim_direction_output;
	chip->get = sim_get;
	chip->set = compat_gpio_set(sim_set);
	sim_interrupt_init(sim);
	return gpiochip_add_data(chip, sim);
}

void sim_chip_remove(struct sim *sim)
{
	gpiochip_remove(&sim->chip);
	irq_work_sync(&sim->work);
}

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
static int sim_inputs_parse(const struct sim *sim, char *text, unsigned long *mask,
			    unsigned long *bits)
{
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
	return bitmap_empty(mask, INCISE_SIM_LINES_MAX) ? -EINVAL : 0;
}

static ssize_t sim_inputs_write(struct file *file, const char __user *from, size_t size,
				loff_t *unused)
{
	struct sim *sim = ((struct seq_file *)file->private_data)->private;
	DECLARE_BITMAP(mask, INCISE_SIM_LINES_MAX) = {};
	DECLARE_BITMAP(bits, INCISE_SIM_LINES_MAX) = {};
	unsigned long flags;
	unsigned int line;
	char *text;
	int ret;

	text = sim_text_read(from, size);
	if (IS_ERR(text))
		return PTR_ERR(text);
	ret = sim_inputs_parse(sim, text, mask, bits);
	kfree(text);
	if (ret)
		return ret;

	raw_spin_lock_irqsave(&sim->lock, flags);
	for_each_set_bit(line, mask, sim->lines)
		sim_drive_locked(sim, line, test_bit(line, bits));
	sim_settle_locked(sim);
	raw_spin_unlock_irqrestore(&sim->lock, flags);
	return size;
}

static const struct file_operations sim_inputs_fops = {
	.owner = THIS_MODULE,
	.open = sim_inputs_open,
	.read = seq_read,
	.write = sim_inputs_write,
	.llseek = seq_lseek,
	.release = single_release,
};

void sim_chip_files(struct sim *sim)
{
	debugfs_create_file("inputs", 0600, sim->dir, sim, &sim_inputs_fops);
}
