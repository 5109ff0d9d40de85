// SPDX-License-Identifier: GPL-2.0-only
/*
 * Faults of a chip: interrupts that are late, missing or refused, and lines
 * that cannot be read; and the machine's sleep: for one driver alone, or for all devices but those
 * that a guest has its files from. See incise_sim.h for the words of the files.
 */
#include <linux/fs.h>
#include <linux/module.h>
#include <linux/pci.h>
#include <linux/platform_device.h>
#include <linux/pm.h>

#include "sim.h"

static int sim_to_irq(struct gpio_chip *chip, unsigned int line)
{
	struct sim *sim = gpiochip_get_data(chip);
	int ret = READ_ONCE(sim->no_irq);

	return ret ? ret : sim->to_irq(chip, line);
}

/* The chip was added just now: gpiolib has set its to_irq(). */
void sim_faults_chip(struct sim *sim)
{
	sim->no_irq = 0;
	bitmap_zero(sim->unreadable, INCISE_SIM_LINES_MAX);
	sim->to_irq = sim->chip.to_irq;
	sim->chip.to_irq = sim_to_irq;
}

static int sim_faults_interrupts(struct sim *sim, const char *how)
{
	if (!strcmp(how, "held") || !strcmp(how, "come"))
		sim_interrupt_hold(sim, !strcmp(how, "held"));
	else if (!strcmp(how, "none"))
		WRITE_ONCE(sim->no_irq, -ENXIO);
	else if (!strcmp(how, "refused"))
		WRITE_ONCE(sim->no_irq, -EIO);
	else
		return -EINVAL;
	return 0;
}

static int sim_faults_parse(void *of, char *text)
{
	char *word = sim_text_word(&text), *value;
	struct sim *sim = of;
	int line, ret;

	if (!word || sim_text_word(&text))
		return -EINVAL;
	if (sim_text_key(word, "interrupts", &value))
		return sim_faults_interrupts(sim, value);
	if (sim_text_key(word, "unreadable", &value)) {
		ret = sim_text_line(sim, value, &line);
		if (!ret)
			set_bit(line, sim->unreadable);
		return ret;
	}
	if (strcmp(word, "none"))
		return -EINVAL;
	WRITE_ONCE(sim->no_irq, 0);
	bitmap_zero(sim->unreadable, INCISE_SIM_LINES_MAX);
	sim_interrupt_hold(sim, false);
	return 0;
}

static ssize_t sim_faults_write(struct file *file, const char __user *from, size_t size,
				loff_t *unused)
{
	return sim_text_write(from, size, sim_faults_parse, file->private_data);
}

static const struct file_operations sim_faults_fops = {
	.owner = THIS_MODULE,
	.open = simple_open,
	.write = sim_faults_write,
};

static int sim_stay_awake(const char *name)
{
	struct device *dev = bus_find_device_by_name(&pci_bus_type, NULL, name);

	if (!dev)
		return -ENODEV;
	dev_pm_syscore_device(dev, true);
	put_device(dev);
	return 0;
}

static int sim_sleep_parse(void *of, char *text)
{
	char *word = sim_text_word(&text), *name;
	const struct dev_pm_ops *pm;
	struct device *dev;
	bool resume;
	int ret = -ENODEV;

	if (!word || sim_text_word(&text))
		return -EINVAL;
	if (sim_text_key(word, "awake", &name))
		return sim_stay_awake(name);
	resume = sim_text_key(word, "resume", &name);
	if (!resume && !sim_text_key(word, "suspend", &name))
		return -EINVAL;
	dev = bus_find_device_by_name(&platform_bus_type, NULL, name);
	if (!dev)
		return -ENODEV;
	device_lock(dev);
	pm = dev->driver ? dev->driver->pm : NULL;
	if (pm && resume)
		ret = pm->resume ? pm->resume(dev) : 0;
	else if (pm)
		ret = pm->suspend ? pm->suspend(dev) : 0;
	device_unlock(dev);
	put_device(dev);
	return ret;
}

static ssize_t sim_sleep_write(struct file *file, const char __user *from, size_t size,
			       loff_t *unused)
{
	return sim_text_write(from, size, sim_sleep_parse, NULL);
}

static const struct file_operations sim_sleep_fops = {
	.owner = THIS_MODULE,
	.open = simple_open,
	.write = sim_sleep_write,
};

void sim_faults_files(struct sim *sim)
{
	debugfs_create_file("faults", 0200, sim->dir, sim, &sim_faults_fops);
	debugfs_create_file("sleep", 0200, sim->dir, sim, &sim_sleep_fops);
}
