"""Experiments over seeds: arms, statistics, verdicts on published orders, their report. Uses report and synthetic logs; the
experiments by name are in `pipelines/experiments`.
"""
